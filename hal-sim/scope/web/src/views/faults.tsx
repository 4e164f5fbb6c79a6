import { useState } from "preact/hooks";
import { ask, notice, status, tell } from "../drive";
import type { JournalEvent, Sentence } from "../messages";

function Sentences(props: { title: string; list: Sentence[] }) {
  if (props.list.length === 0) return null;
  return (
    <>
      <h3>{props.title}</h3>
      <ul>
        {props.list.map((one) => (
          <li key={one.name}><strong>{one.name}</strong>: {one.sentence}</li>
        ))}
      </ul>
    </>
  );
}

async function journal(): Promise<JournalEvent[]> {
  const all: JournalEvent[] = [];
  for (;;) {
    const some = (await ask({ command: "journal", after: all.length })).events ?? [];
    if (some.length === 0 || all.length > 200) return all;
    all.push(...some);
  }
}

function Value(props: { event: JournalEvent }) {
  const { value, limit, unit } = props.event;
  if (value === null || unit === null) return null;
  return <> ({value} {unit}{limit === null ? "" : `, limit ${limit} ${unit}`})</>;
}

export function Faults() {
  const now = status.value;
  const [events, setEvents] = useState<JournalEvent[]>([]);
  const show = () => journal().then(setEvents).catch((error: Error) => notice(error.message));
  const fault = now?.fault;
  const limits = now ? [...now.limited_by, ...now.screw.limited_by, ...now.nut.limited_by] : [];
  return (
    <section class="card">
      <h2>Faults and limits</h2>
      <div role="alert">
        {fault && <p class="fault"><strong>{fault.name}</strong>: {now?.misalignment?.sentence ?? fault.sentence}</p>}
      </div>
      {!fault && <p class="muted">No fault.</p>}
      <Sentences title="Also found" list={now?.further_faults ?? []} />
      <Sentences title="Limited by" list={limits} />
      <Sentences title="Warnings" list={now?.warnings ?? []} />
      <Sentences title="Compensation tables" list={(now?.tables ?? []).map((one) => ({ ...one, name: `${one.table}, ${one.name}` }))} />
      <div class="row">
        <button type="button" disabled={!fault} onClick={() => tell({ command: "reset" })}>Reset fault</button>
        <button type="button" onClick={show}>Show journal</button>
      </div>
      {events.length > 0 && (
        <ol class="journal">
          {events.map((event) => (
            <li key={event.number}>{event.uptime_s.toFixed(3)} s: {event.kind}: {event.name}<Value event={event} /></li>
          ))}
        </ol>
      )}
    </section>
  );
}
