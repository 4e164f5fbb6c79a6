import { useMemo } from "preact/hooks";
import type { AlignedData } from "uplot";
import { quantity } from "../format";
import type { Crossing, LoopResponse } from "../messages";
import { Chart } from "./chart";

const SERIES = [{ label: "measured", color: "#3b82f6" }, { label: "model", color: "#868e96" }];

/** A loop, measured by steps, beside the model of the settings that hold. */
export function ResponseCharts({ loop, found }: { loop: string; found: LoopResponse }) {
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
    <section aria-label={loop}>
      <p>
        {loop}: {found.steps} steps from {found.from.toFixed(2)} to {found.to.toFixed(2)} {found.unit}
      </p>
      <table>
        <thead>
          <tr><th>loop</th><th>bandwidth</th><th>phase margin</th></tr>
        </thead>
        <tbody>
          {row("measured", found.crossing)}
          {row("model", found.predicted_crossing)}
        </tbody>
      </table>
      <Chart title="Step response" x="ms" unit="of the step" series={SERIES} data={time} height={180} />
      <Chart title="Measured gain" x="Hz" unit="dB" series={SERIES} data={gain} height={160} log />
      <Chart title="Measured phase" x="Hz" unit="°" series={SERIES} data={phase} height={160} log />
    </section>
  );
}
