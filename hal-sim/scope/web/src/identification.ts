// From two recordings of the drive to the effect that its model lacks, and to its compensation.

import { signal } from "@preact/signals";
import { operating_points } from "scope";
import { call, identify } from "./drive";
import type { Compensation, Found } from "./messages";
import { pass, ready, rest, runAt, setRate } from "./operation";
import { change } from "./settings";

/** Transient between two operating points, s. */
const RAMP_S = 0.25;
/** Each step of the speed task, and each fifth. */
const [FULL, PLOTTED] = [1, 5];

type Point = [velocity_mm_s: number, common_speed_rpm: number];
interface OperatingPoints {
  fit: Point[];
  check: Point[];
  held_s: number;
}

/** What is going on; empty: nothing. */
export const doing = signal("");
export const found = signal<Found | null>(null);
export const compensation = signal<Compensation | null>(null);

async function recordRun(points: Point[], held_s: number, name: string): Promise<Float64Array> {
  await call({ name: "begin recording" });
  for (const [index, [velocity, common]] of points.entries()) {
    doing.value = `Recording the ${name} run: ${index + 1} of ${points.length} speeds.`;
    await runAt(velocity, common);
    await pass(held_s + RAMP_S);
  }
  return (await call({ name: "take recording" })) as Float64Array;
}

/** Records a fit and a check run, and identifies what they have beyond the declared model. It throws a sentence. */
export async function recordAndIdentify() {
  const { fit, check, held_s } = JSON.parse(operating_points()) as OperatingPoints;
  try {
    await ready();
    await setRate(FULL);
    await pass(0.2);
    const records: [Float64Array, Float64Array] = [await recordRun(fit, held_s, "fit"), await recordRun(check, held_s, "check")];
    const declared = (await call({ name: "declared" })) as string;
    await rest();
    await setRate(PLOTTED);
    doing.value = "Identifying.";
    const result = await identify(declared, ...records);
    compensation.value = (await call({ name: "compensation", model: result.model })) as Compensation;
    found.value = result;
  } finally {
    doing.value = "";
  }
}

/** Sets what compensates the model that was found. The drive restarts if a setting needs it. It throws a sentence. */
export async function compensate() {
  const settings = compensation.value?.settings ?? {};
  await rest();
  if (!(await change(new Map(Object.entries(settings))))) throw new Error("The settings were not taken.");
}
