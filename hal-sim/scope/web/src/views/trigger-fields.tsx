import { columns } from "../drive";
import { held, trigger } from "./window";

export function TriggerFields() {
  const now = trigger.value;
  const set = (part: Partial<typeof now>) => {
    trigger.value = { ...now, ...part };
    held.value = false;
  };
  return (
    <details>
      <summary>Trigger{now.on ? (held.value ? ": fired" : ": armed") : ""}</summary>
      <div class="row">
        <label><input type="checkbox" checked={now.on} onChange={() => set({ on: !now.on })} /> on</label>
        <label>
          Signal{" "}
          <select value={now.column} onChange={(event) => set({ column: Number(event.currentTarget.value) })}>
            {columns.map((one, column) => <option key={one.name} value={column}>{one.group} {one.label}</option>)}
          </select>
        </label>
        <label>
          Edge{" "}
          <select value={now.edge} onChange={(event) => set({ edge: event.currentTarget.value as "rising" | "falling" })}>
            <option>rising</option>
            <option>falling</option>
          </select>
        </label>
        <label>
          Level <input type="number" step="any" value={now.level} onInput={(event) => set({ level: event.currentTarget.valueAsNumber || 0 })} />
        </label>
        <label>
          Before, %{" "}
          <input type="number" min="0" max="100" value={Math.round(100 * now.before)} onInput={(event) => set({ before: Math.min(1, Math.max(0, (event.currentTarget.valueAsNumber || 0) / 100)) })} />
        </label>
        <label><input type="checkbox" checked={now.single} onChange={() => set({ single: !now.single })} /> single</label>
        <button type="button" disabled={!now.on} onClick={() => set({})}>Arm trigger</button>
      </div>
    </details>
  );
}
