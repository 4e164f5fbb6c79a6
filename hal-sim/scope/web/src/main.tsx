import { render } from "preact";
import { choose, notice, start as startDrive } from "./drive";
import { sentenceOf } from "./format";
import { start as startSettings } from "./settings";
import { Page } from "./views/page";
import { start as startWasm } from "./wasm";

/** The line of the server that served this page, if one did. */
function served(): string | null {
  const own = new URL(location.href);
  if (!own.protocol.startsWith("http") || own.searchParams.has("sim")) return null;
  const line = new URL("/line", own);
  line.protocol = own.protocol === "https:" ? "wss:" : "ws:";
  const token = own.searchParams.get("token");
  if (token) line.searchParams.set("token", token);
  return line.href;
}

async function main() {
  const root = document.getElementById("page")!;
  try {
    startDrive(await startWasm());
    startSettings();
    const url = served();
    choose(url ? { kind: "socket", url } : { kind: "simulation", board: "mains", cold: false, effects: "" });
  } catch (error) {
    notice(`This browser cannot run the page: ${sentenceOf(error)}`);
  }
  render(<Page />, root);
}

void main();
