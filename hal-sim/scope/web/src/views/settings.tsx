import { signal } from "@preact/signals";
import { useRef } from "preact/hooks";
import type { SettingSchema } from "../messages";
import { change, edit, edited, held, learned, lostInRestart, readLearned, restarts, schema, unstored } from "../settings";

const search = signal("");
const onlyChanged = signal(false);

function possible(one: SettingSchema): string {
  if ("choice" in one.kind) return one.kind.choice.join(", ");
  const [low, high] = "real" in one.kind ? one.kind.real : one.kind.whole;
  return `${low} to ${high} ${one.unit}`;
}

function Setting(props: { one: SettingSchema }) {
  const { one } = props;
  const value = edited.value.get(one.name) ?? held.value.get(one.name) ?? "";
  const differs = held.value.get(one.name) !== one.default;
  const about = `${one.doc} Possible: ${possible(one)}. Default: ${one.default}. Takes effect ${one.effect}.`;
  const label = `${one.name}${one.unit ? `, ${one.unit}` : ""}`;
  return (
    <li class={edited.value.has(one.name) ? "edited" : ""}>
      <label for={`setting-${one.id}`}>{label}{differs && <span class="differs" title="differs from the default"> ●</span>}</label>
      {"choice" in one.kind ? (
        <select id={`setting-${one.id}`} value={value} onChange={(event) => edit(one.name, event.currentTarget.value)}>
          {one.kind.choice.map((word) => <option key={word}>{word}</option>)}
        </select>
      ) : (
        <input id={`setting-${one.id}`} type="text" inputMode="decimal" value={value} onInput={(event) => edit(one.name, event.currentTarget.value)} />
      )}
      <p class="muted">{about}</p>
    </li>
  );
}

function Confirm(props: { restart: boolean; set: () => void; cancel: () => void }) {
  return (
    <div class="confirm" role="alertdialog" aria-label="Confirm the change">
      {props.restart ? (
        <p>The drive restarts for this. It loses: {lostInRestart().join("; ")}.</p>
      ) : (
        <p>The settings take effect without a restart.</p>
      )}
      <button type="button" onClick={props.set}>{props.restart ? "Set and restart" : "Set"}</button>
      <button type="button" onClick={props.cancel}>Cancel</button>
    </div>
  );
}

const asked = signal(false);

export function SettingsTree() {
  const box = useRef<HTMLDivElement>(null);
  const word = search.value.toLowerCase();
  const found = schema.value.filter(
    (one) =>
      held.value.has(one.name) &&
      (one.name.toLowerCase().includes(word) || one.doc.toLowerCase().includes(word)) &&
      (!onlyChanged.value || held.value.get(one.name) !== one.default),
  );
  const groups = [...new Set(found.map((one) => one.group))];
  const open = word.length > 1 || onlyChanged.value;
  const set = async () => {
    asked.value = false;
    if (await change(edited.value)) edited.value = new Map();
  };
  const different = [...learned.value].filter(([name, value]) => value !== held.value.get(name));
  return (
    <section class="card">
      <h2>Settings</h2>
      <div class="row">
        <label>Search <input type="search" value={search.value} onInput={(event) => (search.value = event.currentTarget.value)} /></label>
        <label><input type="checkbox" checked={onlyChanged.value} onChange={() => (onlyChanged.value = !onlyChanged.value)} /> not default</label>
      </div>
      <p class="muted">{found.length} of {schema.value.length} settings</p>
      <div class="tree" ref={box} tabIndex={0} role="group" aria-label="List of settings">
        {groups.map((group) => (
          <details key={group} open={open}>
            <summary>{group}</summary>
            <ul>{found.filter((one) => one.group === group).map((one) => <Setting key={one.id} one={one} />)}</ul>
          </details>
        ))}
      </div>
      <div class="row">
        <button type="button" disabled={edited.value.size === 0} onClick={() => (asked.value = true)}>Set {edited.value.size} changed</button>
        <button type="button" disabled={edited.value.size === 0} onClick={() => (edited.value = new Map())}>Undo</button>
        <button type="button" onClick={readLearned}>Show learned orders</button>
      </div>
      {asked.value && <Confirm restart={restarts(edited.value.keys())} set={set} cancel={() => (asked.value = false)} />}
      {unstored.value && <p class="muted">The new values hold. The drive stores them when it is at rest.</p>}
      {learned.value.size > 0 && (
        <p class="muted">
          {different.length === 0 ? "Nothing is learned that the settings do not have." : "Learned, not saved:"}
        </p>
      )}
      {different.length > 0 && <ul class="learned">{different.map(([name, value]) => <li key={name}>{name} = {value}</li>)}</ul>}
    </section>
  );
}
