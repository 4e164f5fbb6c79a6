// Ten seconds of the default drive in WebAssembly, as the example `ten_seconds` runs them natively.
// node measure/equal.mjs WASM_FOLDER NATIVE_LINES: prints JSON.
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, lines] = process.argv.slice(2);
const { initSync, SimulatedDrive, Session } = await import(pathToFileURL(join(folder, "scope.js")).href);
initSync({ module: await readFile(join(folder, "scope_bg.wasm")) });

const REQUESTS = new Map([
  [0, { command: "hello" }],
  [400, { command: "arm" }],
  [420, { command: "record", divider: 1 }],
  [440, { command: "run", velocity_mm_s: 2.5, common_speed_rpm: 500 }],
  [8000, { command: "stop" }],
]);

// Speed: after 2 s of simulated time the engine has optimised the code.
const timed = new SimulatedDrive("mains", false, "");
timed.advance(2000);
const begun = performance.now();
timed.advance(10_000);
const seconds = (performance.now() - begun) / 1000;

const drive = new SimulatedDrive("mains", false, "");
const line = drive.open();
const session = new Session();
const native = (await readFile(lines, "utf8")).trimEnd().split("\n");
let different = 0;
let first = null;
for (let ms = 0; ms < 10_000; ms += 20) {
  drive.receive(line, session.request(JSON.stringify(REQUESTS.get(ms) ?? { command: "heartbeat" })));
  drive.advance(20);
  const bytes = drive.outgoing(line);
  session.push(bytes);
  if (Buffer.from(bytes).toString("hex") !== native[ms / 20]) {
    different++;
    first ??= ms;
  }
}
console.log(JSON.stringify({ wasm_equal: different === 0, different_pieces: different, first_difference_ms: first, wasm_times_real_time: 10 / seconds }));
