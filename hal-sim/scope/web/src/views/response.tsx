import { signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import type { AlignedData } from "uplot";
import { notice } from "../drive";
import { quantity, sentenceOf } from "../format";
import type { Crossing, CurrentResponse } from "../messages";
import { measureResponse, measuring, response } from "../response";
import { Chart } from "./chart";

const SERIES = [{ label: "measured", color: "#3b82f6" }, { label: "model", color: "#868e96" }];

const motor = signal(0);

async function measure() {
  try {
    await measureResponse(motor.value);
  } catch (error) {
    notice(sentenceOf(error));
  }
}

function Curves({ found }: { found: CurrentResponse }) {
  const [time, gain, phase] = useMemo(
    () => [
      [found.time_s.map((s) => 1e3 * s), found.measured, found.predicted] as AlignedData,
      [found.hz, found.gain_db, found.predicted_gain_db] as AlignedData,
      [found.hz, found.phase_deg, found.predicted_phase_deg] as AlignedData,
    ],
    [found],
  );
  const row = (name: string, of: Crossing | null) => (
    <tr>
      <th scope="row">{name}</th>
      <td>{of ? quantity(of.bandwidth_rad_s / (2 * Math.PI), "Hz", 1) : "none"}</td>
      <td>{of ? quantity(of.margin_deg, "°", 1) : "none"}</td>
    </tr>
  );
  return (
    <>
      <table>
        <thead>
          <tr><th>current loop</th><th>bandwidth</th><th>phase margin</th></tr>
        </thead>
        <tbody>
          {row("measured", found.crossing)}
          {row("model", found.predicted_crossing)}
        </tbody>
      </table>
      <Chart title="Step response" x="ms" unit="of the step" series={SERIES} data={time} height={180} />
      <Chart title="Measured gain" x="Hz" unit="dB" series={SERIES} data={gain} height={160} log />
      <Chart title="Measured phase" x="Hz" unit="°" series={SERIES} data={phase} height={160} log />
    </>
  );
}

export function ResponsePanel() {
  const shown = response.value;
  return (
    <section class="card" aria-label="Current loop, measured">
      <h2>Current loop, measured</h2>
      <p class="muted">Both motors turn together, and the table rests. One motor gets steps of the current along d, which makes no torque.</p>
      <div class="row">
        <label>
          Loop of the{" "}
          <select value={motor.value} onChange={(event) => (motor.value = Number(event.currentTarget.value))}>
            <option value={0}>screw</option>
            <option value={1}>nut</option>
          </select>
        </label>
        <button type="button" disabled={measuring.value !== ""} onClick={() => void measure()}>Measure steps</button>
        <span class="muted" role="status">{measuring.value}</span>
      </div>
      {shown && (
        <>
          <p>
            {shown.motor}: {shown.found.steps} steps from {shown.found.from_a.toFixed(2)} to {shown.found.to_a.toFixed(2)} A
          </p>
          <Curves found={shown.found} />
        </>
      )}
    </section>
  );
}
