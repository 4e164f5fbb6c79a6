// Steps that take a while: runs, restarts, recordings. A stop ends each.

import { ask, connection, status, stop, stops, tell } from "./drive";
import { held } from "./settings";
import { arm, commonSpeed, tableSpeed } from "./views/commands";

const LEARNING = "compensation.learning_s";

const wait = (ms: number) => new Promise((done) => setTimeout(done, ms));

export const is = (...states: string[]) => connection.value.open && states.includes(status.value?.state ?? "");

export const learns = () => Number(held.value.get(LEARNING) ?? 0) > 0;

/** Waits so long; it throws if a stop comes. */
export async function pass(seconds: number) {
  const begun = stops.value;
  for (let tenth = 0; tenth < 10 * seconds; tenth++) {
    await wait(100);
    if (stops.value !== begun) throw new Error("A stop ended this step.");
  }
}

/** Waits until something holds; it throws if that does not come. */
export async function reached(what: string, holds: () => boolean, seconds = 20) {
  for (let tenth = 0; tenth < 10 * seconds; tenth++) {
    if (holds()) return;
    await pass(0.1);
  }
  throw new Error(`The drive did not become ${what}.`);
}

/** Brings the drive to rest. */
export async function rest() {
  if (is("ready", "unaligned")) return;
  stop();
  await wait(50);
  await reached("ready", () => is("ready", "unaligned"));
}

/** Arms the drive, and aligns it first where it does not know its rotors. */
export async function ready() {
  await reached("ready", () => is("ready", "unaligned", "running", "holding"));
  if (!status.value?.armed && !(await arm())) throw new Error("The drive was not armed.");
  await reached("armed", () => status.value?.armed === true && is("ready", "running", "holding"));
}

/** Runs at a table velocity and a common speed. */
export async function runAt(velocity_mm_s: number, common_speed_rpm: number) {
  await ask({ command: "run", velocity_mm_s, common_speed_rpm });
  [tableSpeed.value, commonSpeed.value] = [velocity_mm_s, common_speed_rpm];
}

/** Sets the rate of telemetry: each `divider`th step of the speed task. */
export const setRate = (divider: number) => tell({ command: "record", divider });
