// Measures the page in Chromium: node measure/page.mjs SECONDS. Prints JSON. With DDFEED it also kills a page that moves a drive.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { button, chromiumAt, launch, launchServer, open, run, state } from "../browser.mjs";
import { program, Served } from "../served.mjs";

const seconds = Number(process.argv[2] ?? 60);
const STOPS = 200;

const median = (values) => values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)];

const browser = await launch();
const begun = performance.now();
const { tab } = await open(browser, { viewport: { width: 1440, height: 1000 } });
const firstPicture = performance.now() - begun;

// Accessibility, with all that can be folded open.
await tab.evaluate(() => document.querySelectorAll("details").forEach((one) => (one.open = true)));
const axe = await readFile(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const cdp = await tab.context().newCDPSession(tab);
await cdp.send("Page.setBypassCSP", { enabled: true });
await tab.evaluate(axe);
const found = await tab.evaluate(() => globalThis.axe.run());
const serious = found.violations.filter((one) => ["serious", "critical"].includes(one.impact));

// Plots of all signals at 1 kHz. The table goes to and fro within its travel.
await tab.evaluate(() => document.querySelectorAll(".tree details").forEach((one) => (one.open = false)));
await button(tab, "All").click();
const signals = Number((await tab.getByText(/^Choose signals/).innerText()).match(/\((\d+) of/)[1]);
await run(tab);
/** The other way, so that the table stays within its travel. */
async function turnRound() {
  const speed = tab.getByLabel("Table speed", { exact: true });
  await speed.fill(String(-Number(await speed.inputValue())));
}
const memory = async () => (await cdp.send("Runtime.getHeapUsage")).usedSize / 1e6;
await tab.waitForTimeout(3000);
const heap = [await memory()];
const frames = [];
for (let second = 0; second < seconds; second++) {
  await tab.waitForTimeout(1000);
  frames.push(Number.parseFloat(await tab.locator("#frame-rate").innerText()));
  if (second % 25 === 24) {
    await turnRound();
    await button(tab, "Run").click();
  }
}
heap.push(await memory());
const lost = Number.parseInt(await tab.getByText(/rows lost/).innerText());

// From the press to the drive's confirmation.
const stops = [];
for (let k = 0; k < STOPS; k++) {
  await turnRound();
  if (k > 0) await run(tab);
  await tab.keyboard.press("Escape");
  await tab.getByText("· not armed").waitFor();
  stops.push(Number.parseFloat((await tab.locator("#stop-ms").innerText()).replace(/^.*after /, "")));
  await state(tab, "ready");
}
await browser.close();

/** Travel of the table from the kill of a page that runs the drive at 2.5 mm/s until rest, by the drive's own scale. */
async function killedPage() {
  const served = await new Served().start();
  const victim = await launchServer();
  try {
    const position = async () => {
      const { table, state } = await served.status();
      return { position_mm: table.position_mm, state };
    };
    const other = await chromiumAt(victim);
    const { tab } = await open(other, {}, served.address);
    await run(tab);
    await tab.waitForTimeout(1000);
    const before = await position();
    victim.process().kill("SIGKILL");
    await new Promise((resolve) => setTimeout(resolve, 2000));
    const after = await position();
    if (before.state !== "running" || after.state !== "fault") throw new Error(`from ${before.state} to ${after.state}`);
    return Math.abs(after.position_mm - before.position_mm);
  } finally {
    await victim.kill();
    await served.end();
  }
}

console.log(
  JSON.stringify({
    fps_median: median(frames),
    fps_worst_second: Math.min(...frames),
    seconds,
    signals,
    rate_hz: 1000,
    lost,
    heap_mb: heap,
    stop_ms: { median: median(stops), worst: Math.max(...stops), count: stops.length },
    first_picture_ms: firstPicture,
    killed_page_travel_mm: program ? await killedPage() : null,
    axe_serious: serious.map((one) => ({ id: one.id, places: one.nodes.map((node) => node.target.join(" ")) })),
  }),
);
