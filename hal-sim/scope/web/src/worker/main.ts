// The worker: source, session, heartbeat. The page only draws.

import { identify, initSync } from "scope";
import type { Call, Command, CommissioningWanted, Found, FromDrive, FromWorker, SourceChoice, ToWorker } from "../messages";
import { sentenceOf } from "../format";
import { Dialogue } from "./dialogue";
import { Life } from "./life";
import { open } from "./open";
import type { Source } from "./source";

const TICK_MS = 5;
const BEAT_MS = 20;
const STATUS_MS = 100;
const ROWS_MS = 33;
const HELLO_MS = 500;
/** A drive that says nothing for so long is shown as silent. */
const SILENCE_MS = 500;
/** The page hears so often how far a commissioning is. */
const REPORT_MS = 100;
/** A lost server is asked for so often. */
const AGAIN_MS = 1000;
/** Steps of the speed task from row to row: 1 kHz of the usual 5 kHz. */
const DIVIDER = 5;

let source: Source | null = null;
let dialogue: Dialogue | null = null;
let simulated = false;
let inSession = false;
/** When the last reply came, and whether that is too long ago. */
let heardAt = 0;
let silent = false;
/** This page has armed the drive, so it sends heartbeats. */
let commands = false;
let stopAsked: number | null = null;
/** The steps of a commissioning ask the drive, and nobody else moves it. */
let commissions = false;
/** What the page may ask during a commissioning. */
const READS = ["status", "settings", "faults", "journal"];
/** A new number with each source: answers of an older one do nothing. */
let opened = 0;
const life = new Life();
/** The server that was lost, and when it is asked for again. */
let again: { choice: SourceChoice; due: number } | null = null;
const due = { hello: 0, beat: 0, status: 0, rows: 0, stop: 0, report: 0 };

const post = (message: FromWorker, transfer: Transferable[] = []) => postMessage(message, { transfer });

function connection(open: boolean, sentence: string) {
  post({ type: "connection", open, sentence, simulated });
}

async function choose(choice: SourceChoice) {
  endCommissioning();
  dialogue?.close();
  dialogue = source = null;
  inSession = commands = false;
  stopAsked = again = null;
  const mine = ++opened;
  connection(false, "Connecting to the drive.");
  try {
    const next = await open(choice, (sentence) => {
      if (mine === opened) lost(choice, sentence);
    });
    if (mine !== opened) return next.close();
    source = next;
    dialogue = new Dialogue(next, heard);
  } catch (error) {
    if (mine !== opened) return;
    connection(false, sentenceOf(error));
    askAgain(choice);
  }
}

function askAgain(choice: SourceChoice) {
  if (choice.kind === "socket") again = { choice, due: performance.now() + AGAIN_MS };
}

function lost(choice: SourceChoice, sentence: string) {
  if (choice.kind === "simulation") return post({ type: "notice", sentence });
  endCommissioning();
  dialogue?.close();
  dialogue = source = null;
  inSession = commands = false;
  connection(false, sentence);
  askAgain(choice);
}

function heard(message: FromDrive) {
  if ("stream" in message) return post({ type: "stream", stream: message.stream });
  if (!("reply" in message)) return;
  const { reply } = message;
  heardAt = performance.now();
  if (silent && inSession) connection(true, "");
  silent = false;
  if (reply.hello) {
    inSession = true;
    simulated = reply.hello.simulated;
    post({ type: "rates", rates: reply.hello });
    // A commissioning has a stream of its own.
    if (!commissions) dialogue?.tell({ command: "record", divider: DIVIDER });
    connection(true, "");
  } else if (reply.status && dialogue) {
    if (reply.status.fault) commands = false;
    post({ type: "status", status: reply.status, counts: dialogue.counts() });
  } else if (reply.refused?.name === "no session" && inSession && !commissions) {
    // The drive has restarted.
    inSession = commands = false;
    connection(false, "The drive restarts.");
  }
}

async function answer(id: number, command: Command) {
  try {
    if (!dialogue || !inSession) throw new Error("There is no drive yet.");
    if (commissions && !READS.includes(command.command)) throw new Error("The drive is being commissioned: stop it first.");
    if (command.command === "arm") commands = true;
    const reply = await dialogue.ask(command);
    post({ type: "answer", id, reply, error: reply ? null : "The drive does not answer." });
  } catch (error) {
    post({ type: "answer", id, reply: null, error: sentenceOf(error) });
  }
}

function call(id: number, asked: Call) {
  try {
    if (!dialogue) throw new Error("There is no drive yet.");
    post({ type: "result", id, result: dialogue.call(asked), error: null });
  } catch (error) {
    post({ type: "result", id, result: null, error: sentenceOf(error) });
  }
}

/** Identifies. The page has a worker of its own for this: it takes seconds. */
function identified(declared: string, fit: Float64Array, check: Float64Array) {
  try {
    post({ type: "identified", found: JSON.parse(identify(declared, fit, check)) as Found, error: null });
  } catch (error) {
    post({ type: "identified", found: null, error: sentenceOf(error) });
  }
}

function commission(wanted: CommissioningWanted) {
  try {
    if (!dialogue || !inSession) throw new Error("There is no drive yet.");
    if (commissions) throw new Error("The drive is being commissioned: stop it first.");
    dialogue.commission(wanted);
    commissions = true;
  } catch (error) {
    post({ type: "notice", sentence: sentenceOf(error) });
  }
}

/** Tells the page how far the commissioning is. */
function report() {
  const found = dialogue?.commissioning();
  if (found) post({ type: "commissioning", report: found });
}

/** Ends it, if there is one: it sends nothing any more. */
function endCommissioning() {
  if (!commissions) return;
  commissions = false;
  dialogue?.stopCommissioning();
  report();
  if (inSession) dialogue?.tell({ command: "record", divider: DIVIDER });
}

/** Sends a stop now and again until the drive confirms it. */
function stop(now: number) {
  due.stop = now + BEAT_MS;
  endCommissioning();
  commands = false;
  const current = dialogue;
  if (!current || !inSession) return;
  void current.ask({ command: "stop" }).then((reply) => {
    if (!reply?.done || stopAsked === null) return;
    post({ type: "stopped", ms: performance.now() - stopAsked });
    stopAsked = null;
  });
}

function tick() {
  const now = performance.now();
  if (again && now > again.due) void choose(again.choice);
  if (!dialogue) return;
  if (commissions) commands = true;
  if (commands && life.missing) {
    stopAsked = now;
    stop(now);
    post({ type: "notice", sentence: "The page did not answer, so the drive was stopped." });
  } else if (stopAsked !== null && now > due.stop) {
    stop(now);
  }
  // A commissioning opens its session anew by itself: a second opening would end it.
  if (!inSession && !commissions && now > due.hello) {
    due.hello = now + HELLO_MS;
    dialogue.tell({ command: "hello" });
  }
  if (inSession && !silent && now - heardAt > SILENCE_MS) {
    silent = true;
    connection(false, "The drive does not answer.");
  }
  if (inSession && commands && now > due.beat) {
    due.beat = now + BEAT_MS;
    dialogue.tell({ command: "heartbeat" });
  }
  if (inSession && now > due.status) {
    due.status = now + STATUS_MS;
    dialogue.tell({ command: "status" });
  }
  dialogue.listen();
  if (commissions) {
    if (!dialogue.pollCommissioning(now)) {
      commands = false;
      endCommissioning();
    } else if (now > due.report) {
      due.report = now + REPORT_MS;
      report();
    }
  }
  if (now > due.rows) {
    due.rows = now + ROWS_MS;
    const rows = dialogue.rows();
    if (rows.length > 0) post({ type: "rows", rows }, [rows.buffer]);
    const machine = source?.machine();
    if (machine) post({ type: "machine", machine });
  }
}

onmessage = ({ data }: MessageEvent<ToWorker>) => {
  switch (data.type) {
    case "start":
      initSync({ module: data.module });
      setInterval(tick, TICK_MS);
      break;
    case "source":
      void choose(data.source);
      break;
    case "ask":
      void answer(data.id, data.command);
      break;
    case "call":
      call(data.id, data.call);
      break;
    case "identify":
      identified(data.declared, data.fit, data.check);
      break;
    case "commission":
      commission(data.wanted);
      break;
    case "stop":
      stopAsked = performance.now();
      stop(stopAsked);
      break;
    case "alive":
      life.sign(data.hidden);
      break;
  }
};
