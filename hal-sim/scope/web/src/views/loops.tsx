import { computed, signal } from "@preact/signals";
import { loops as loopsOf } from "scope";
import type { AlignedData } from "uplot";
import { rates } from "../drive";
import { quantity } from "../format";
import { edit, edited, held } from "../settings";
import { Chart } from "./chart";

interface Loop {
  motor: string;
  loop: string;
  bandwidth_hz: number;
  margin_deg: number;
  hz: number[];
  gain_db: number[];
  phase_deg: number[];
}

/** Gains on a slider: setting, label, unit. */
const GAINS = [
  ["tuning.speed_rad_s", "Cutoff of the speed loops", "rad/s"],
  ["tuning.current_rad_s", "Cutoff of the current loops", "rad/s"],
  ["tuning.observer_rad_s", "Frequency of the observers", "rad/s"],
  ["tuning.damping", "Damping of the loops", ""],
] as const;
/** A slider goes from a part of the value that holds to a multiple. */
const SPAN = 4;
const STEPS = 100;

const shown = signal(1);

function predicted(values: ReadonlyMap<string, string>): Loop[] {
  if (!rates.value || held.value.size === 0) return [];
  const found = JSON.parse(loopsOf(JSON.stringify(Object.fromEntries(values)), rates.value.pwm_hz, rates.value.speed_hz)) as Loop[] | { error: string };
  return "error" in found ? [] : found;
}

const now = computed(() => predicted(held.value));
const next = computed(() => (edited.value.size === 0 ? now.value : predicted(new Map([...held.value, ...edited.value]))));

const nameOf = (one: Loop) => `${one.motor}, ${one.loop}`;

function Gain(props: { name: string; label: string; unit: string }) {
  const { name, label, unit } = props;
  const holds = Number(held.value.get(name));
  if (!(holds > 0)) return null;
  const value = Number(edited.value.get(name) ?? holds);
  const position = Math.round((STEPS * Math.log(value / holds)) / Math.log(SPAN));
  const take = (event: Event) => {
    const at = (event.currentTarget as HTMLInputElement).valueAsNumber;
    edit(name, at === 0 ? held.value.get(name)! : String(Number((holds * SPAN ** (at / STEPS)).toPrecision(3))));
  };
  return (
    <div class="field">
      <label>
        {label}
        <input type="range" min={-STEPS} max={STEPS} step={1} value={position} aria-valuetext={`${value} ${unit}`} onInput={take} />
      </label>
      <span>{value} {unit}</span>
    </div>
  );
}

export function LoopMargins() {
  const changed = edited.value.size > 0;
  const one = next.value[shown.value];
  return (
    <section class="card">
      <h2>Loops, predicted</h2>
      {GAINS.map(([name, label, unit]) => <Gain key={name} name={name} label={label} unit={unit} />)}
      <table>
        <thead>
          <tr><th>loop</th><th>bandwidth</th><th>phase margin</th>{changed && <th>margin now</th>}</tr>
        </thead>
        <tbody>
          {next.value.map((each, k) => (
            <tr key={nameOf(each)}>
              <th scope="row">{nameOf(each)}</th>
              <td>{quantity(each.bandwidth_hz, "Hz", 1)}</td>
              <td>{quantity(each.margin_deg, "°", 1)}</td>
              {changed && <td>{quantity(now.value[k]?.margin_deg, "°", 1)}</td>}
            </tr>
          ))}
        </tbody>
      </table>
      {changed && next.value.length === 0 && <p class="muted">A changed setting has no possible value.</p>}
      <details>
        <summary>Bode plot</summary>
        <label>
          Loop{" "}
          <select value={shown.value} onChange={(event) => (shown.value = Number(event.currentTarget.value))}>
            {next.value.map((each, k) => <option key={nameOf(each)} value={k}>{nameOf(each)}</option>)}
          </select>
        </label>
        {one && <Bode one={one} before={changed ? now.value[shown.value] : undefined} />}
      </details>
      <p class="muted">The model of the tuning: winding, inertia and delays of the settings, without friction and without resonance. Set the changed values below.</p>
    </section>
  );
}

function Bode(props: { one: Loop; before: Loop | undefined }) {
  const { one, before } = props;
  const series = [{ label: "open loop", color: "#3b82f6" }, ...(before ? [{ label: "open loop now", color: "#868e96" }] : [])];
  const curves = (pick: (of: Loop) => number[]) => [one.hz, pick(one), ...(before ? [pick(before)] : [])] as AlignedData;
  return (
    <>
      <Chart title="Gain" x="Hz" unit="dB" series={series} data={curves((of) => of.gain_db)} height={160} log />
      <Chart title="Phase" x="Hz" unit="°" series={series} data={curves((of) => of.phase_deg)} height={160} log />
    </>
  );
}
