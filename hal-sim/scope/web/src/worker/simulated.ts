// The simulated drive in this worker, in real time.

import { SimulatedDrive } from "scope";
import type { Machine } from "../messages";
import type { Source } from "./source";

/** Time that is caught up with; what is beyond is left out and reported. */
const CATCH_UP_MS = 200;

export class SimulatedSource implements Source {
  private readonly drive: SimulatedDrive;
  private readonly line: number;
  private passed = performance.now();
  private slow = false;

  constructor(board: string, cold: boolean, effects: string, private readonly lost: (sentence: string) => void) {
    this.drive = new SimulatedDrive(board, cold, effects);
    this.line = this.drive.open();
  }

  send(bytes: Uint8Array) {
    this.drive.receive(this.line, bytes);
  }

  poll(): Uint8Array[] {
    const now = performance.now();
    if (now - this.passed > CATCH_UP_MS) {
      if (!this.slow) this.lost("This computer simulates the drive slower than real time.");
      this.slow = true;
      this.passed = now - CATCH_UP_MS;
    }
    const ms = Math.floor(now - this.passed);
    if (ms > 0) {
      this.drive.advance(ms);
      this.passed += ms;
    }
    const bytes = this.drive.outgoing(this.line);
    return bytes.length > 0 ? [bytes] : [];
  }

  machine(): Machine {
    return JSON.parse(this.drive.machine()) as Machine;
  }

  declared(): string {
    return this.drive.declared();
  }

  close() {
    this.drive.free();
  }
}
