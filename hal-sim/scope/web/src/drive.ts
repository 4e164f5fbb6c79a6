// The page's side of the drive: what is known of it, and requests.

import { signal } from "@preact/signals";
import { signals as signalList } from "scope";
import workerScript from "worker-script";
import { sentenceOf } from "./format";
import type { Call, Command, Commissioning, CommissioningWanted, Counts, Found, FromWorker, Machine, Rates, Reply, Signal, SourceChoice, Status, Stream, ToWorker } from "./messages";
import { Rows } from "./rows";

const ALIVE_MS = 100;
const NOTICES = 4;

export const connection = signal({ open: false, sentence: "Starting.", simulated: false });
export const status = signal<Status | null>(null);
export const counts = signal<Counts | null>(null);
export const machine = signal<Machine | null>(null);
export const stream = signal<Stream | null>(null);
export const rates = signal<Rates | null>(null);
/** The commissioning that is under way or was the last. */
export const commissioning = signal<Commissioning | null>(null);
export const notices = signal<string[]>([]);
export const stopMs = signal<number | null>(null);
export const source = signal<SourceChoice | null>(null);
/** Counts up with each piece of rows. */
export const arrived = signal(0);
/** Counts up with each stop: what waits in a sequence of requests is dropped. */
export const stops = signal(0);

export let columns: Signal[] = [];
export let rows = new Rows(1);

let worker: Worker;
let compiled: WebAssembly.Module;
let next = 0;
const called = new Map<number, { resolve: (result: unknown) => void; reject: (error: Error) => void }>();
const waiting = new Map<number, { resolve: (reply: Reply) => void; reject: (error: Error) => void }>();

const post = (message: ToWorker) => worker.postMessage(message);

/** Shows a sentence. */
export function notice(sentence: string) {
  notices.value = [...notices.value.filter((other) => other !== sentence), sentence].slice(-NOTICES);
}

export function dismiss(sentence: string) {
  notices.value = notices.value.filter((other) => other !== sentence);
}

const newWorker = () => new Worker(URL.createObjectURL(new Blob([workerScript], { type: "text/javascript" })));

export function start(module: WebAssembly.Module) {
  columns = JSON.parse(signalList()) as Signal[];
  rows = new Rows(columns.length);
  compiled = module;
  worker = newWorker();
  worker.onmessage = ({ data }: MessageEvent<FromWorker>) => take(data);
  post({ type: "start", module });
  setInterval(() => post({ type: "alive", hidden: document.hidden }), ALIVE_MS);
  addEventListener("pagehide", stop);
}

export function choose(choice: SourceChoice) {
  source.value = choice;
  status.value = machine.value = stream.value = commissioning.value = null;
  rows.clear();
  post({ type: "source", source: choice });
}

function take(message: FromWorker) {
  switch (message.type) {
    case "connection":
      connection.value = message;
      break;
    case "rates":
      rates.value = message.rates;
      break;
    case "answer":
      answered(message.id, message.reply, message.error);
      break;
    case "status":
      status.value = message.status;
      counts.value = message.counts;
      break;
    case "machine":
      machine.value = message.machine;
      break;
    case "stream":
      stream.value = message.stream;
      rows.clear();
      break;
    case "rows":
      rows.append(message.rows);
      arrived.value++;
      break;
    case "commissioning":
      commissioning.value = message.report;
      break;
    case "notice":
      notice(message.sentence);
      break;
    case "result":
      returned(message.id, message.result, message.error);
      break;
    case "stopped":
      stopMs.value = message.ms;
      break;
  }
}

function answered(id: number, reply: Reply | null, error: string | null) {
  const asked = waiting.get(id);
  waiting.delete(id);
  const refused = reply?.refused?.sentence ?? reply?.unfit ?? error;
  if (refused) asked?.reject(new Error(refused));
  else if (reply) asked?.resolve(reply);
}

/** Asks the drive. It throws the drive's sentence where that refuses. */
export function ask(command: Command): Promise<Reply> {
  const id = next++;
  return new Promise((resolve, reject) => {
    waiting.set(id, { resolve, reject });
    post({ type: "ask", id, command });
  });
}

function returned(id: number, result: unknown, error: string | null) {
  const asked = called.get(id);
  called.delete(id);
  if (error) asked?.reject(new Error(error));
  else asked?.resolve(result);
}

/** Asks the worker for what it does by itself. */
export function call(asked: Call): Promise<unknown> {
  const id = next++;
  return new Promise((resolve, reject) => {
    called.set(id, { resolve, reject });
    post({ type: "call", id, call: asked });
  });
}

/** Identifies in a worker of its own, so that heartbeats go on. */
export function identify(declared: string, fit: Float64Array, check: Float64Array): Promise<Found> {
  const own = newWorker();
  return new Promise<Found>((resolve, reject) => {
    own.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      if (data.type !== "identified") return;
      if (data.found) resolve(data.found);
      else reject(new Error(data.error ?? "The identification ended."));
    };
    own.onerror = () => reject(new Error("The identification failed."));
    own.postMessage({ type: "start", module: compiled } satisfies ToWorker);
    own.postMessage({ type: "identify", declared, fit, check } satisfies ToWorker);
  }).finally(() => own.terminate());
}

/** Asks the drive, and shows its sentence where it refuses. True if it is done. */
export async function tell(command: Command): Promise<boolean> {
  try {
    await ask(command);
    return true;
  } catch (error) {
    notice(sentenceOf(error));
    return false;
  }
}

export const commission = (wanted: CommissioningWanted) => post({ type: "commission", wanted });

export function stop() {
  stops.value++;
  post({ type: "stop" });
}
