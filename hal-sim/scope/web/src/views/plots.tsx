import { signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { orders, spectrum } from "scope";
import type { AlignedData } from "uplot";
import { columns, counts } from "../drive";
import type { Signal } from "../messages";
import { Chart } from "./chart";
import { COLORS } from "./colors";
import { FrameRate } from "./frame-rate";
import { SignalList, chosen } from "./signal-list";
import { TriggerFields } from "./trigger-fields";
import { held, seconds, seldom, shown, type Shown } from "./window";

type Kind = "time" | "spectrum" | "orders of the screw" | "orders of the nut";
const KINDS: Kind[] = ["time", "spectrum", "orders of the screw", "orders of the nut"];
const kind = signal<Kind>("time");

function choose(which: Kind) {
  kind.value = which;
  seldom.value = which !== "time";
}

const columnOf = (name: string) => columns.findIndex((one) => one.name === name);

/** x and y of one signal, as the kind of plot has them. */
function curve(which: Kind, data: Shown, column: number): [Float64Array, Float64Array] {
  const values = data.values[column]!;
  if (which === "time") return [data.values[0]!, values];
  const whole = values.map((value) => (Number.isFinite(value) ? value : 0));
  const pairs =
    which === "spectrum"
      ? spectrum(whole, data.interval)
      : orders(whole, data.values[columnOf(which === "orders of the screw" ? "screw_angle" : "nut_angle")]!.map((turns) => turns * 2 * Math.PI));
  const half = pairs.length / 2;
  return [Float64Array.from({ length: half }, (_, k) => pairs[2 * k]!), Float64Array.from({ length: half }, (_, k) => pairs[2 * k + 1]!)];
}

const AXES: Record<Kind, string> = { time: "s", spectrum: "Hz", "orders of the screw": "periods a screw turn", "orders of the nut": "periods a nut turn" };

/** The signals of one unit in one plot. */
function UnitPlot(props: { unit: string; signals: Signal[]; data: Shown; which: Kind; height: number }) {
  const { unit, signals, data, which, height } = props;
  const aligned = useMemo(() => {
    if (data.values.length === 0) return [[], ...signals.map(() => [])] as unknown as AlignedData;
    const curves = signals.map((one) => curve(which, data, columnOf(one.name)));
    return [curves[0]![0], ...curves.map(([, y]) => y)] as unknown as AlignedData;
  }, [data, which, signals.map((one) => one.name).join()]);
  const series = signals.map((one, k) => ({ label: `${one.group} ${one.label}`, color: COLORS[k % COLORS.length]! }));
  return <Chart title={which === "time" ? "Signals" : `Amplitude by ${which}`} x={AXES[which]} unit={unit} series={series} data={aligned} height={height} />;
}

export function Plots() {
  const data = shown.value;
  const picked = columns.filter((one) => chosen.value.has(one.name));
  const units = [...new Set(picked.map((one) => one.unit))];
  const height = units.length > 2 ? 160 : 220;
  return (
    <section class="card">
      <h2>Signals</h2>
      <div class="row">
        <label>
          Plot{" "}
          <select value={kind.value} onChange={(event) => choose(event.currentTarget.value as Kind)}>
            {KINDS.map((one) => <option key={one}>{one}</option>)}
          </select>
        </label>
        <label>
          Window{" "}
          <select value={seconds.value} onChange={(event) => (seconds.value = Number(event.currentTarget.value))}>
            {[0.5, 1, 2, 4, 10, 30].map((one) => <option key={one} value={one}>{one} s</option>)}
          </select>
        </label>
        <button type="button" aria-pressed={held.value} onClick={() => (held.value = !held.value)}>{held.value ? "Go on" : "Hold"}</button>
        <FrameRate />
        <span class="muted">{counts.value ? `${counts.value.lost} rows lost` : ""}</span>
      </div>
      {units.map((unit) => (
        <UnitPlot key={unit} unit={unit} signals={picked.filter((one) => one.unit === unit)} data={data} which={kind.value} height={height} />
      ))}
      {units.length === 0 && <p class="muted">Choose a signal below.</p>}
      <SignalList />
      <TriggerFields />
    </section>
  );
}
