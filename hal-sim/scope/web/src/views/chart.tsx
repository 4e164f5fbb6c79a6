import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";

export interface Series {
  label: string;
  color: string;
}

interface ChartProps {
  title: string;
  x: string;
  unit: string;
  series: Series[];
  data: uPlot.AlignedData;
  height: number;
  /** The x axis is logarithmic. */
  log?: boolean;
}

const style = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A tick that keeps its digits, however small it is. */
const short = (tick: number) => String(Number(tick.toPrecision(4)));

/** A plot with cursor, legend, and zoom by dragging; a double click shows all. */
export function Chart({ title, x, unit, series, data, height, log = false }: ChartProps) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const key = series.map((one) => one.label).join("\n") + unit + x;
  useEffect(() => {
    const element = place.current!;
    const axis = { stroke: style("--text"), grid: { stroke: style("--grid") }, ticks: { stroke: style("--grid") } };
    plot.current = new uPlot(
      {
        width: Math.max(element.clientWidth, 200),
        height,
        scales: { x: { time: false, distr: log ? 3 : 1 } },
        axes: [{ ...axis, label: x, labelSize: 20, size: 34 }, { ...axis, label: unit, labelSize: 20, size: 60, values: (_, ticks) => ticks.map(short) }],
        series: [{ label: x }, ...series.map((one) => ({ label: one.label, stroke: one.color, width: 1, spanGaps: false, points: { show: false } }))],
        legend: { live: true },
      },
      data,
      element,
    );
    const observer = new ResizeObserver(() => plot.current?.setSize({ width: Math.max(element.clientWidth, 200), height }));
    observer.observe(element);
    return () => {
      observer.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [key, height]);
  useEffect(() => {
    plot.current?.setData(data);
  }, [data]);
  return (
    <figure class="chart">
      <div ref={place} role="img" aria-label={`${title} in ${unit} over ${x}`} />
    </figure>
  );
}
