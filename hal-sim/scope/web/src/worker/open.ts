// Opens what the drive's bytes come from.

import type { SourceChoice } from "../messages";
import { SerialSource } from "./serial";
import { SimulatedSource } from "./simulated";
import { SocketSource } from "./socket";
import type { Source } from "./source";

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
