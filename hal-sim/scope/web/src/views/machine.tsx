import { connection, machine, status, stream } from "../drive";
import { quantity } from "../format";

/** Width of the travel in the picture, in its own units. */
const TRAVEL = 240;
const LEFT = 40;
const MIDDLE = LEFT + TRAVEL / 2;

/** A disc that turns: a ring with a mark. */
function Disc(props: { x: number; turns: number; label: string }) {
  const angle = (props.turns % 1) * 360;
  return (
    <g>
      <circle cx={props.x} cy="60" r="16" class="disc" />
      <line x1={props.x} y1="60" x2={props.x} y2="46" class="mark" transform={`rotate(${angle} ${props.x} 60)`} />
      <text x={props.x} y="96" class="label">{props.label}</text>
    </g>
  );
}

export function MachinePicture() {
  const now = status.value;
  const picture = machine.value;
  const travel = picture?.travel_mm ?? 0;
  const table = picture?.table_mm ?? now?.table.position_mm ?? 0;
  const part = travel > 0 ? Math.max(-0.5, Math.min(0.5, table / travel)) : 0;
  const x = MIDDLE + part * TRAVEL;
  const words =
    `Table at ${quantity(table, "mm", 3)}` +
    (picture ? `, brake ${picture.brake_holds ? "closed" : "open"}, load ${quantity(picture.load_n, "N", 0)}` : "");
  return (
    <section class="card">
      <h2>Machine</h2>
      <svg class="machine" viewBox="0 0 320 130" role="img" aria-label={words}>
        <line x1={LEFT} y1="60" x2={LEFT + TRAVEL} y2="60" class="screw" />
        {Array.from({ length: 24 }, (_, k) => (
          <line key={k} x1={LEFT + k * 10} y1="56" x2={LEFT + 6 + k * 10} y2="64" class="thread" />
        ))}
        <rect x={LEFT - 4} y="30" width="4" height="14" class={picture?.end_backward ? "switch on" : "switch"} />
        <rect x={LEFT + TRAVEL} y="30" width="4" height="14" class={picture?.end_forward ? "switch on" : "switch"} />
        <rect x={x - 26} y="22" width="52" height="18" rx="3" class="table" />
        <rect x={x - 14} y="40" width="28" height="34" rx="3" class="nut" />
        <Disc x={20} turns={picture?.screw_turns ?? 0} label="screw" />
        <Disc x={x} turns={picture?.nut_turns ?? 0} label="nut" />
        {picture && <rect x="296" y="52" width="12" height="16" class={picture.brake_holds ? "brake on" : "brake"} />}
        {picture && <text x="302" y="96" class="label">brake</text>}
      </svg>
      <dl class="values">
        <div><dt>table</dt><dd>{quantity(now?.table.position_mm, "mm", 4)}</dd></div>
        <div><dt>velocity</dt><dd>{quantity(now?.table.velocity_mm_s, "mm/s", 3)}</dd></div>
        <div><dt>screw</dt><dd>{quantity(now?.screw.speed_rpm, "rpm", 1)}</dd></div>
        <div><dt>nut</dt><dd>{quantity(now?.nut.speed_rpm, "rpm", 1)}</dd></div>
        <div><dt>screw i_q</dt><dd>{quantity(now?.screw.current_q_a, "A", 3)}</dd></div>
        <div><dt>nut i_q</dt><dd>{quantity(now?.nut.current_q_a, "A", 3)}</dd></div>
        <div><dt>homed</dt><dd>{now ? (now.table.homed ? "yes" : "no") : "–"}</dd></div>
        <div><dt>move</dt><dd>{now?.travel ?? "–"}</dd></div>
        {picture && <div><dt>brake</dt><dd>{picture.brake_holds ? "closed" : "open"}</dd></div>}
        {stream.value && <div><dt>lead</dt><dd>{quantity(stream.value.lead_mm, "mm", 1)}</dd></div>}
      </dl>
      {!connection.value.open && <p class="muted">{connection.value.sentence}</p>}
    </section>
  );
}
