// Ripple of the table's velocity in the last seconds.

import { computed, signal } from "@preact/signals";
import { ripple as rippleOf } from "scope";
import { arrived, columns, rows, stream } from "./drive";

export interface Ripple {
  vrf_percent: number;
  rms_percent: number;
  bandwidth_hz: number;
  mean_mm_s: number;
}

const SECONDS = 2;
/** Pieces of rows between two computations: about four a second. */
const EVERY = 8;

/** What was kept to compare with. */
export const before = signal<Ripple | null>(null);

const turn = computed(() => Math.floor(arrived.value / EVERY));

/** Ripple of the last `seconds`, or why there is none. */
export function measure(seconds: number): Ripple | string {
  const interval = stream.value?.interval_s;
  if (!interval) return "There is no telemetry yet.";
  const column = columns.findIndex((one) => one.name === "table_position");
  const count = Math.round(seconds / interval);
  if (rows.length < count) return "There is not enough telemetry yet.";
  const metres = Float64Array.from(rows.last(column, count), (mm) => mm * 1e-3);
  const result = JSON.parse(rippleOf(metres, interval)) as Ripple | { error: string };
  return "error" in result ? result.error : result;
}

export const now = computed(() => {
  void turn.value;
  return measure(SECONDS);
});
