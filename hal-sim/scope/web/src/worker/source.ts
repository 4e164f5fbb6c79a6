// Where the drive's bytes come from.

import type { Machine } from "../messages";

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
