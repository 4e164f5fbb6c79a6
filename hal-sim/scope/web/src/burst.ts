// A burst: every PWM period of a motor around a trigger, armed in the drive and read from it.

import { signal } from "@preact/signals";
import { burst_signals } from "scope";
import { ask, call } from "./drive";
import { sentenceOf } from "./format";
import type { BurstStatus, Signal } from "./messages";

const LOOK_MS = 200;

export interface BurstRequest {
  motor: number;
  trigger: string;
  before_percent: number;
  divider: number;
}

/** A burst that was read: its columns, of which the first is time. */
export interface Burst {
  motor: string;
  interval: number;
  columns: Float64Array[];
}

/** Signals after the time. */
export const burstSignals = (): Pick<Signal, "name" | "label" | "unit">[] => JSON.parse(burst_signals());
export const burst = signal<Burst | null>(null);
/** What the panel says of it. */
export const going = signal("No burst was read.");

/** A new number with each press of a button: what an older one waits for ends. */
let turn = 0;

const wait = (ms: number) => new Promise((done) => setTimeout(done, ms));

async function burstStatus(): Promise<BurstStatus> {
  const reply = await ask({ command: "burst_status" });
  if (!reply.burst) throw new Error("The drive does not say how the burst is going.");
  return reply.burst;
}

/** Has the session read the samples of a complete burst. */
async function readSamples(status: BurstStatus) {
  for (let count = 0; count < status.samples; ) {
    const reply = await ask({ command: "burst_samples", from: count });
    if (reply.samples === undefined || reply.samples <= count) throw new Error("The drive sends no samples of the burst.");
    count = reply.samples;
  }
}

async function read(status: BurstStatus): Promise<Burst> {
  await readSamples(status);
  const rows = (await call({ name: "burst rows" })) as Float64Array;
  const width = burstSignals().length + 1;
  const columns = Array.from({ length: width }, (_, column) => Float64Array.from({ length: rows.length / width }, (_, row) => rows[row * width + column]!));
  return { motor: status.motor === 0 ? "screw" : "nut", interval: status.interval_s, columns };
}

async function untilRead(mine: number) {
  for (;;) {
    const now = await burstStatus();
    if (mine !== turn) return;
    going.value = now.sentence;
    if (now.state === "none") return;
    if (now.state === "complete") {
      const kept = await read(now);
      if (mine === turn) burst.value = kept;
      return;
    }
    await wait(LOOK_MS);
    if (mine !== turn) return;
  }
}

async function said(step: (mine: number) => Promise<void>) {
  const mine = ++turn;
  try {
    await step(mine);
  } catch (error) {
    if (mine === turn) going.value = sentenceOf(error);
  }
}

/** Arms a burst, and reads it once it is complete. */
export const armBurst = (request: BurstRequest) =>
  said(async (mine) => {
    await ask({ command: "burst", ...request });
    await untilRead(mine);
  });

/** Reads the burst that was armed before, once it is complete. */
export const readBurst = () => said(untilRead);

/** Ends the burst that waits. What was read stays. */
export const endBurst = () =>
  said(async () => {
    await ask({ command: "end_burst" });
    going.value = (await burstStatus()).sentence;
  });
