// A trigger over the rows that have come: where a signal crosses a level.

export interface Trigger {
  on: boolean;
  column: number;
  level: number;
  edge: "rising" | "falling";
  /** Part of the window before the crossing. */
  before: number;
  /** Holds after one window. */
  single: boolean;
}

/** The row of the last crossing that has a whole window around it; null if there is none. */
export function crossing(values: Float64Array, trigger: Trigger, window: number): number | null {
  const first = Math.max(1, Math.ceil(trigger.before * window));
  const last = values.length - Math.ceil((1 - trigger.before) * window);
  const sign = trigger.edge === "rising" ? 1 : -1;
  for (let row = last; row >= first; row--) {
    const was = sign * (values[row - 1]! - trigger.level);
    const is = sign * (values[row]! - trigger.level);
    if (was < 0 && is >= 0) return row;
  }
  return null;
}
