import { signal } from "@preact/signals";
import { status, stop, stopMs, tell } from "../drive";
import { Field } from "./field";

export const tableSpeed = signal(2.5);
export const commonSpeed = signal(500);
const distance = signal(1);

const speeds = () => ({ velocity_mm_s: tableSpeed.value, common_speed_rpm: commonSpeed.value });

export const arm = () => tell({ command: "arm" });
export const run = () => tell({ command: "run", ...speeds() });

export function Commands() {
  const now = status.value;
  const most = now?.table.limits.velocity_mm_s ?? 100;
  const rpm = Math.min(now?.screw.limits.speed_rpm ?? 3000, now?.nut.limits.speed_rpm ?? 3000);
  const armed = now?.armed ?? false;
  return (
    <section class="card">
      <h2>Commands</h2>
      <div class="row">
        <button type="button" onClick={arm} disabled={armed}>Arm</button>
        <button type="button" onClick={stop}>Stop and disarm</button>
      </div>
      {stopMs.value !== null && <p class="muted" id="stop-ms">The drive confirmed the last stop after {stopMs.value.toFixed(1)} ms.</p>}
      {now?.state === "unaligned" && <p class="muted">The drive does not know its rotor angles. Arm aligns the motors: both move.</p>}
      <Field label="Table speed" unit="mm/s" value={tableSpeed} low={-most} high={most} step={0.1} />
      <Field label="Common speed" unit="rpm" value={commonSpeed} low={0} high={rpm} step={10} />
      <div class="row">
        <button type="button" onClick={run} disabled={!armed}>Run</button>
        <button type="button" onClick={() => tell({ command: "home", common_speed_rpm: commonSpeed.value })} disabled={!armed}>Home</button>
      </div>
      <Field label="Distance" unit="mm" value={distance} low={-100} high={100} step={0.1} />
      <button
        type="button"
        disabled={!armed}
        onClick={() => tell({ command: "move", distance_mm: distance.value, velocity_mm_s: Math.abs(tableSpeed.value), common_speed_rpm: commonSpeed.value })}
      >
        Move
      </button>
    </section>
  );
}
