// The rows that the plots show: the last seconds, or those around a trigger, or those that were held.

import { computed, signal } from "@preact/signals";
import { arrived, columns, rows, stream } from "../drive";
import { crossing, type Trigger } from "./trigger";

export const seconds = signal(4);
export const held = signal(false);
export const trigger = signal<Trigger>({ on: false, column: 0, level: 0, edge: "rising", before: 0.25, single: true });

export interface Shown {
  interval: number;
  /** Values of each column. */
  values: Float64Array[];
}

/** Pieces of rows between two copies for a plot that takes long to compute. */
const EVERY = 8;
/** The plot is a spectrum: a copy now and again is enough. */
export const seldom = signal(false);

const due = computed(() => (seldom.value ? Math.floor(arrived.value / EVERY) : arrived.value));

let last: Shown = { interval: 1, values: [] };

function copy(from: number, to: number, interval: number): Shown {
  return { interval, values: columns.map((_, column) => rows.range(column, from, to).slice()) };
}

/** A new copy with each piece of rows, unless the plots are held. */
export const shown = computed<Shown>(() => {
  void due.value;
  const interval = stream.value?.interval_s;
  if (held.value || !interval) return last;
  const count = Math.round(seconds.value / interval);
  const asked = trigger.value;
  if (!asked.on) {
    last = copy(rows.length - count, rows.length, interval);
    return last;
  }
  const row = crossing(rows.range(asked.column, 0, rows.length), asked, count);
  if (row === null) return last;
  const from = Math.round(row - asked.before * count);
  last = copy(from, from + count, interval);
  if (asked.single) queueMicrotask(() => (held.value = true));
  return last;
});
