// Measures the page in Chromium: node measure/page.mjs SECONDS. Prints JSON.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { button, launch, open, run, state } from "../browser.mjs";

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

console.log(
  JSON.stringify({
    fps_median: median(frames),
    fps_worst_second: Math.min(...frames),
    seconds,
    signals: 19,
    rate_hz: 1000,
    lost,
    heap_mb: heap,
    stop_ms: { median: median(stops), worst: Math.max(...stops), count: stops.length },
    first_picture_ms: firstPicture,
    axe_serious: serious.map((one) => ({ id: one.id, places: one.nodes.map((node) => node.target.join(" ")) })),
  }),
);
