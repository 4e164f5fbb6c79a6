// Where the drive's bytes come from.

import type { Machine, SourceChoice } from "../messages";
import { SerialSource } from "./serial";
import { SimulatedSource } from "./simulated";
import { SocketSource } from "./socket";

export interface Source {
  /** Sends bytes to the drive. */
  send(bytes: Uint8Array): void;
  /** Lets time pass; gives what the drive has sent. */
  poll(): Uint8Array[];
  /** The machine, where it is a simulated one on this page. */
  machine(): Machine | null;
  /** The model file of the machine, where the source has one. */
  declared(): string | null;
  close(): void;
}

/** Opens a source. `lost` is called with a sentence when it is gone. */
export async function open(choice: SourceChoice, lost: (sentence: string) => void): Promise<Source> {
  switch (choice.kind) {
    case "simulation":
      return new SimulatedSource(choice.board, choice.cold, choice.effects, lost);
    case "socket":
      return SocketSource.open(choice.url, lost);
    case "serial":
      return SerialSource.open(choice.baud, lost);
  }
}
