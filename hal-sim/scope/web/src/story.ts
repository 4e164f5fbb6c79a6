// The first visit, step by step.

import { signal } from "@preact/signals";
import { choose, machine, notice } from "./drive";
import { sentenceOf } from "./format";
import { compensate, doing as identifying, found, recordAndIdentify } from "./identification";
import { is, learns, pass, reached, ready, rest, runAt } from "./operation";
import { before, measure, type Ripple } from "./ripple";
import { change } from "./settings";
import { EFFECTS } from "./views/effects";
import { effectSentence } from "./views/identification";

/** Seconds from the start of a run to its ripple: the start's transient, and 2 s that are measured. */
const MEASURED_S = 5;
/** Time in which the drive learns, or checks what it was given. */
const SETTLED_S = 12;

export interface Step {
  title: string;
  about: string;
  button: string;
  act: () => Promise<Ripple | null>;
}

async function rippleAt(rpm: number, seconds: number): Promise<Ripple> {
  await ready();
  await runAt((machine.value?.table_mm ?? 0) > 0 ? -2.5 : 2.5, rpm);
  await pass(seconds);
  const ripple = measure(2);
  if (typeof ripple === "string") throw new Error(ripple);
  return ripple;
}

/** Switches the learning on or off. The drive restarts, and the page reads its settings again. */
async function learn(on: boolean) {
  await reached("ready", () => is("ready", "unaligned", "running", "holding"));
  if (learns() === on) return;
  await rest();
  if (!(await change(new Map([["compensation.learning_s", on ? "0.5" : "0"]])))) throw new Error("The setting was not taken.");
  await reached("ready", () => is("ready", "unaligned") && learns() === on);
}

/** A machine with or without the cogging torque, as it is switched on. */
async function newMachine(cogging: boolean) {
  choose({ kind: "simulation", board: "mains", cold: false, effects: cogging ? EFFECTS[1]!.toml : "" });
  found.value = null;
  await reached("ready", () => is("ready"));
}

export const STEPS: Step[] = [
  {
    title: "Single drive",
    about: "Only the screw turns. It is slow, so the table shows the ripple of its torque.",
    button: "Run at 0 rpm",
    act: async () => {
      await learn(false);
      return (before.value = await rippleAt(0, MEASURED_S));
    },
  },
  {
    title: "Double drive",
    about: "Both motors turn fast. The table moves with the difference. The drive learns what repeats with the angles.",
    button: "Run at 500 rpm",
    act: async () => {
      await learn(true);
      return rippleAt(500, SETTLED_S);
    },
  },
  {
    title: "An unknown effect",
    about: "A new machine has a cogging torque that its model lacks. This drive does not learn.",
    button: "Add cogging",
    act: async () => {
      await newMachine(true);
      return (before.value = await rippleAt(500, MEASURED_S));
    },
  },
  {
    title: "Its name",
    about: "The drive runs through ten speeds. The page compares the recordings with the model.",
    button: "Record and name it",
    act: async () => {
      await recordAndIdentify();
      return null;
    },
  },
  {
    title: "Gone",
    about: "The drive compensates what the model has now.",
    button: "Compensate",
    act: async () => {
      await compensate();
      await pass(0.5);
      return rippleAt(500, SETTLED_S);
    },
  },
];

/** Title of the step that runs; empty: none. */
export const running = signal("");
export const results = signal<ReadonlyMap<string, string>>(new Map());

export async function perform(step: Step) {
  running.value = step.title;
  try {
    const ripple = await step.act();
    const named = found.value?.report.effects[0];
    const result = ripple ? `Ripple ${ripple.vrf_percent.toFixed(1)} %` : named ? effectSentence(named) : "No effect was named.";
    results.value = new Map(results.value).set(step.title, result);
  } catch (error) {
    notice(sentenceOf(error));
  } finally {
    running.value = "";
  }
}

/** What a step shows: what goes on, or what came of it. */
export function outcome(step: Step): string {
  if (running.value === step.title) return identifying.value || "Running.";
  return results.value.get(step.title) ?? "Not done yet.";
}
