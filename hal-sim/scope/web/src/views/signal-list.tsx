import { signal } from "@preact/signals";
import { columns } from "../drive";

export const chosen = signal<ReadonlySet<string>>(new Set(["table_velocity", "screw_torque_current", "nut_torque_current"]));

function toggle(name: string) {
  const next = new Set(chosen.value);
  if (!next.delete(name)) next.add(name);
  chosen.value = next;
}

export function SignalList() {
  const all = columns.slice(1);
  const groups = [...new Set(all.map((one) => one.group))];
  return (
    <details>
      <summary>Choose signals ({chosen.value.size} of {all.length})</summary>
      <div class="row">
        <button type="button" onClick={() => (chosen.value = new Set(all.map((one) => one.name)))}>All</button>
        <button type="button" onClick={() => (chosen.value = new Set())}>None</button>
      </div>
      <div class="groups">
        {groups.map((group) => (
          <fieldset key={group}>
            <legend>{group}</legend>
            {all.filter((one) => one.group === group).map((one) => (
              <label key={one.name}>
                <input type="checkbox" checked={chosen.value.has(one.name)} onChange={() => toggle(one.name)} /> {one.label}, {one.unit}
              </label>
            ))}
          </fieldset>
        ))}
      </div>
    </details>
  );
}
