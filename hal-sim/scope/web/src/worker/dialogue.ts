// Requests to the drive and their answers, over a session of the Rust code.

import { Session } from "scope";
import type { Call, Command, Commissioning, CommissioningWanted, Compensation, Counts, FromDrive, Reply } from "../messages";
import type { Source } from "./source";

const ANSWER_MS = 1000;

interface Waiting {
  until: number;
  answer: (reply: Reply | null) => void;
}

export class Dialogue {
  private readonly session = new Session();
  private readonly waiting = new Map<number, Waiting>();

  constructor(private readonly source: Source, private readonly heard: (message: FromDrive) => void) {}

  /** Sends a request. The answer is null if none comes in time. It throws a sentence if there is no such request. */
  ask(command: Command): Promise<Reply | null> {
    const bytes = this.session.request(JSON.stringify(command));
    const sequence = this.session.sequence();
    const answered = new Promise<Reply | null>((answer) => {
      this.waiting.set(sequence, { until: performance.now() + ANSWER_MS, answer });
    });
    this.source.send(bytes);
    return answered;
  }

  /** Sends a request whose answer nobody reads. */
  tell(command: Command) {
    this.source.send(this.session.request(JSON.stringify(command)));
  }

  /** Takes what the drive has sent. */
  listen() {
    for (const bytes of this.source.poll()) {
      for (const message of JSON.parse(this.session.push(bytes)) as FromDrive[]) {
        if ("reply" in message) this.answered(message.reply);
        this.heard(message);
      }
    }
    const now = performance.now();
    for (const [sequence, { until, answer }] of this.waiting) {
      if (now > until) {
        this.waiting.delete(sequence);
        answer(null);
      }
    }
  }

  private answered(reply: Reply) {
    const waiting = this.waiting.get(reply.sequence);
    this.waiting.delete(reply.sequence);
    waiting?.answer(reply);
  }

  rows(): Float64Array {
    return this.session.rows();
  }

  /** Does what the page asks of the session itself. */
  call(call: Call): unknown {
    switch (call.name) {
      case "begin recording":
        return this.session.begin_recording();
      case "take recording":
        return this.session.take_recording();
      case "burst rows":
        return this.session.burst_rows();
      case "declared":
        return this.source.declared() ?? this.session.declared();
      case "compensation":
        return JSON.parse(this.session.compensation(call.model)) as Compensation;
    }
  }

  /** Begins to commission the drive. It throws a sentence if a value is not possible. */
  commission(wanted: CommissioningWanted) {
    this.session.commission(JSON.stringify(wanted));
  }

  /** Goes on with the commissioning, as far as the answers allow. False if there is none. */
  pollCommissioning(now: number): boolean {
    const bytes = this.session.poll_commissioning(now);
    if (bytes.length > 0) this.source.send(bytes);
    return this.session.commissions();
  }

  /** Ends the commissioning: it sends nothing any more. */
  stopCommissioning() {
    this.session.stop_commissioning();
  }

  commissioning(): Commissioning | null {
    return JSON.parse(this.session.commissioning()) as Commissioning | null;
  }

  counts(): Counts {
    return JSON.parse(this.session.counts()) as Counts;
  }

  close() {
    for (const { answer } of this.waiting.values()) answer(null);
    this.waiting.clear();
    this.source.close();
    this.session.free();
  }
}
