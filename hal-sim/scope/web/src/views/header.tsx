import { connection, source, status } from "../drive";
import { StopButton } from "./stop";

function sourceName(): string {
  switch (source.value?.kind) {
    case "simulation":
      return `Simulated in this page: ${source.value.board} board`;
    case "socket":
      return connection.value.simulated ? "Simulated drive at ddfeed scope" : "Drive at ddfeed scope";
    case "serial":
      return "Board at the serial port";
    default:
      return "No drive";
  }
}

export function Header() {
  const { open, sentence } = connection.value;
  const now = status.value;
  const state = open && now ? now.state : "not connected";
  return (
    <header>
      <h1>Double-drive feed</h1>
      <p class="source">{sourceName()}</p>
      <p class={`state ${now?.fault ? "bad" : ""}`} aria-live="polite">
        <strong id="state">{state}</strong>
        {open && now && <span> · {now.armed ? "armed" : "not armed"}</span>}
        {!open && <span> · {sentence}</span>}
      </p>
      <StopButton />
    </header>
  );
}
