import { signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { spectrum } from "scope";
import type { AlignedData } from "uplot";
import { armBurst, burst, burstSignals, endBurst, going, readBurst, type Burst } from "../burst";
import { Chart } from "./chart";
import { COLORS } from "./colors";

const TRIGGERS = { now: "at once", level: "a signal passes a level", fault: "a fault", state: "another state" };

const request = signal({ motor: 1, trigger: "now" as keyof typeof TRIGGERS, signal: "ia_a", edge: "rising", level: 0, before: 25, every: 1 });
const unit = signal("A");

function arm() {
  const { motor, trigger, signal, edge, level, before, every } = request.value;
  const wanted = trigger === "level" ? `${signal}${edge === "rising" ? ">" : "<"}${level}` : trigger;
  void armBurst({ motor, trigger: wanted, before_percent: before, divider: every });
}

/** The signals of the chosen unit against time, and their amplitudes against frequency. */
function Curves({ kept, unit }: { kept: Burst; unit: string }) {
  const picked = burstSignals().flatMap((one, k) => (one.unit === unit ? [{ ...one, values: kept.columns[k + 1]! }] : []));
  const [time, lines] = useMemo(() => {
    const pairs = picked.map(({ values }) => spectrum(values, kept.interval));
    const part = (pair: Float64Array, odd: number) => Float64Array.from({ length: pair.length / 2 }, (_, k) => pair[2 * k + odd]!);
    return [
      [kept.columns[0]!, ...picked.map(({ values }) => values)] as AlignedData,
      [part(pairs[0]!, 0), ...pairs.map((pair) => part(pair, 1))] as AlignedData,
    ];
  }, [kept, unit]);
  const series = picked.map((one, k) => ({ label: `${kept.motor} ${one.label}`, color: COLORS[k % COLORS.length]! }));
  return (
    <>
      <Chart title="Burst" x="s from the trigger" unit={unit} series={series} data={time} height={200} />
      <Chart title="Amplitude in the burst" x="Hz" unit={unit} series={series} data={lines} height={200} />
    </>
  );
}

export function BurstPanel() {
  const now = request.value;
  const set = (part: Partial<typeof now>) => {
    request.value = { ...now, ...part };
  };
  const number = (event: Event, low: number, high: number) => Math.min(high, Math.max(low, (event.currentTarget as HTMLInputElement).valueAsNumber || 0));
  const units = [...new Set(burstSignals().map((one) => one.unit))];
  return (
    <section class="card" aria-label="Burst">
      <h2>Burst</h2>
      <p class="muted">Every PWM period of one motor around a trigger. The drive keeps it, and nothing moves.</p>
      <div class="row">
        <label>
          Burst of the{" "}
          <select value={now.motor} onChange={(event) => set({ motor: Number(event.currentTarget.value) })}>
            <option value={0}>screw</option>
            <option value={1}>nut</option>
          </select>
        </label>
        <label>
          Begins with{" "}
          <select value={now.trigger} onChange={(event) => set({ trigger: event.currentTarget.value as keyof typeof TRIGGERS })}>
            {Object.entries(TRIGGERS).map(([name, words]) => <option key={name} value={name}>{words}</option>)}
          </select>
        </label>
        <label>
          Burst signal{" "}
          <select value={now.signal} disabled={now.trigger !== "level"} onChange={(event) => set({ signal: event.currentTarget.value })}>
            {burstSignals().map((one) => <option key={one.name} value={one.name}>{one.label}, {one.unit}</option>)}
          </select>
        </label>
        <label>
          Burst edge{" "}
          <select value={now.edge} disabled={now.trigger !== "level"} onChange={(event) => set({ edge: event.currentTarget.value })}>
            <option>rising</option>
            <option>falling</option>
          </select>
        </label>
        <label>
          Burst level{" "}
          <input type="number" step="any" value={now.level} disabled={now.trigger !== "level"} onInput={(event) => set({ level: event.currentTarget.valueAsNumber || 0 })} />
        </label>
        <label>
          Before the trigger, %{" "}
          <input type="number" min="0" max="100" value={now.before} onInput={(event) => set({ before: number(event, 0, 100) })} />
        </label>
        <label>
          Keep each nth period{" "}
          <input type="number" min="1" max="255" value={now.every} onInput={(event) => set({ every: Math.round(number(event, 1, 255)) })} />
        </label>
      </div>
      <div class="row">
        <button type="button" onClick={arm}>Begin burst</button>
        <button type="button" onClick={() => void readBurst()}>Read burst</button>
        <button type="button" onClick={() => void endBurst()}>End burst</button>
        <label>
          Burst unit{" "}
          <select value={unit.value} onChange={(event) => (unit.value = event.currentTarget.value)}>
            {units.map((one) => <option key={one}>{one}</option>)}
          </select>
        </label>
        <span class="muted" role="status">{going.value}</span>
      </div>
      {burst.value && <Curves kept={burst.value} unit={unit.value} />}
    </section>
  );
}
