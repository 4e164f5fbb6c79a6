import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { commission, commissioning } from "../drive";
import { lostInRestart } from "../settings";
import type { CommissioningStep, LoopResponse, Quantity } from "../messages";
import { Field } from "./field";
import { ResponseCharts } from "./response";

const travel = signal(10);
const margin = signal(45);

const digits = (value: number) => (value === 0 || (Math.abs(value) >= 1e-3 && Math.abs(value) < 1e5) ? Number(value.toPrecision(4)).toString() : value.toExponential(3));

function Row({ of }: { of: Quantity }) {
  const { value, plus_minus } = of.estimate;
  return (
    <tr>
      <th scope="row">{of.name}</th>
      <td>
        {digits(value)}
        {plus_minus > 0 && ` ± ${digits(plus_minus)}`} {of.unit}
      </td>
      <td>{of.before === null ? "" : digits(of.before)}</td>
    </tr>
  );
}

function Step({ step }: { step: CommissioningStep }) {
  const shown = step.name === "electrical" || step.name === "mechanical" || step.name === "response";
  return (
    <details open={shown}>
      <summary>
        {step.name}: {step.seconds.toFixed(0)} s
      </summary>
      <p class="muted">{step.about}</p>
      {step.quantities.length > 0 && (
        <table>
          <thead>
            <tr><th>quantity</th><th>measured</th><th>set before</th></tr>
          </thead>
          <tbody>
            {step.quantities.map((one) => <Row key={one.name} of={one} />)}
          </tbody>
        </table>
      )}
      {step.limits.map((one) => (
        <p class="muted" key={one.name}>
          {one.name}: {digits(one.reached)} of {digits(one.limit)} {one.unit} allowed
        </p>
      ))}
      <Responses kind="Current" of={step.responses} />
      <Responses kind="Speed" of={step.speed_responses} />
    </details>
  );
}

function Responses({ kind, of }: { kind: string; of: (LoopResponse | null)[] | null }) {
  return (
    <>
      {of?.map((found, motor) => {
        const name = `${kind} loop of the ${motor === 0 ? "screw" : "nut"}`;
        return found ? <ResponseCharts key={name} loop={name} found={found} /> : <p key={name}>{name}: its steps were not seen beside noise and ripple.</p>;
      })}
    </>
  );
}

export function CommissioningPanel() {
  const [sure, setSure] = useState(false);
  const now = commissioning.value;
  const running = now?.running ?? false;
  const begin = (response_only: boolean) => commission({ travel_mm: travel.value, margin_deg: margin.value, response_only });
  return (
    <section class="card" aria-label="Commissioning">
      <h2>Commissioning</h2>
      <p class="muted">
        Measures winding, magnets, inertia, friction, lead and angles, and tunes the loops. Both motors turn, and the table moves by the travel to each side. The drive stores the
        values and restarts, which loses {lostInRestart().join(", ")}.
      </p>
      <Field label="Travel" unit="mm" value={travel} low={1} high={100} step={1} />
      <Field label="Least phase margin" unit="°" value={margin} low={20} high={80} step={1} />
      <label>
        <input type="checkbox" checked={sure} onChange={(event) => setSure(event.currentTarget.checked)} /> The table may move
      </label>
      <div class="row">
        <button type="button" disabled={running || !sure} onClick={() => begin(false)}>Commission</button>
        <button type="button" disabled={running || !sure} onClick={() => begin(true)}>Measure the loops</button>
      </div>
      {now && (
        <p role="status">
          {running ? (
            <>
              {now.step}: {now.about} <progress value={now.part} max={1} aria-label={`Step ${now.step}`} />
            </>
          ) : (
            now.error ?? "All steps are done. Their values hold and are stored."
          )}
        </p>
      )}
      {now?.done.map((step) => <Step key={step.name} step={step} />)}
    </section>
  );
}
