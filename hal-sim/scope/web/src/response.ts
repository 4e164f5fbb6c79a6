// A current loop measured by steps of the current along d, which makes no torque: its response and Bode plot beside the model's.

import { signal } from "@preact/signals";
import { burstStatus, readSamples } from "./burst";
import { ask, call, columns, rows, status } from "./drive";
import type { CurrentResponse, StepPlan } from "./messages";
import { pass, reached, ready, rest } from "./operation";

/** Part of a burst before its trigger, %. */
const BEFORE_PERCENT = 12.5;
/** Rows that the voltage before a step is the mean of. */
const MEAN_ROWS = 100;
/** How long the step's burst may take, s. */
const BURST_S = 2;

/** What is going on; empty: nothing. */
export const measuring = signal("");
export const response = signal<{ motor: string; found: CurrentResponse } | null>(null);

const MOTORS = ["screw", "nut"] as const;

function meanVoltage(motor: string): number {
  const column = columns.findIndex((one) => one.name === `${motor}_voltage_d`);
  const values = rows.last(column, MEAN_ROWS);
  return values.reduce((sum, value) => sum + value, 0) / Math.max(1, values.length);
}

async function step(motor: number, plan: StepPlan): Promise<CurrentResponse | null> {
  const along = (current_a: number) => ask({ command: "direct_current", motor, current_a });
  await along(plan.from_a);
  await pass(plan.settle_s + 0.2);
  const level = meanVoltage(MOTORS[motor]!) + plan.jump_v / 2;
  await ask({ command: "burst", motor, trigger: `ud_v>${level}`, before_percent: BEFORE_PERCENT, divider: 1 });
  await along(plan.to_a);
  for (let waited = 0; ; waited += 0.1) {
    const now = await burstStatus();
    if (now.state === "complete") {
      await readSamples(now);
      return (await call({ name: "add step" })) as CurrentResponse | null;
    }
    if (waited > BURST_S) {
      await ask({ command: "end_burst" });
      throw new Error("The step of the voltage was not seen: the current loop is too slow, or the bus too low.");
    }
    await pass(0.1);
  }
}

/** Turns both motors together, and measures one. The drive rests afterwards. It throws a sentence. */
export async function measureResponse(motor: number) {
  const name = MOTORS[motor]!;
  try {
    measuring.value = "Starting the motors.";
    await ready();
    const plan = (await call({ name: "begin steps", motor, bus_v: status.value?.[name].bus_v ?? 0 })) as StepPlan;
    const rpm = plan.common_speed_rpm;
    await ask({ command: "run", velocity_mm_s: 0, common_speed_rpm: rpm });
    await reached("as fast as was asked", () => Math.abs((status.value?.[name].speed_rpm ?? 0) - rpm) < 0.1 * rpm);
    for (let count = 1; count <= plan.steps; count++) {
      measuring.value = `Step ${count} of ${plan.steps}.`;
      const found = await step(motor, plan);
      if (found) response.value = { motor: name, found };
    }
  } finally {
    measuring.value = "Coming to rest.";
    await rest().finally(() => (measuring.value = ""));
  }
}
