import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { button, launch, open, run, state } from "../browser.mjs";

let browser;
before(async () => (browser = await launch()));
after(async () => browser?.close());

/** A test with a fresh tab. */
const withTab = (name, body, options) =>
  test(name, { timeout: 240_000 }, async (context) => {
    const opened = await open(browser, options);
    try {
      await body(opened, context);
      assert.deepEqual(opened.errors, []);
    } finally {
      await opened.context.close();
    }
  });

withTab("the page opens from a file and asks no network", async ({ requests }) => {
  const outside = requests.filter((url) => !/^(file|blob|data):/.test(url));
  assert.deepEqual(outside, []);
});

withTab("nothing moves before the drive is armed", async ({ tab }) => {
  assert.equal(await button(tab, "Run").isDisabled(), true);
  assert.equal(await button(tab, "Move").isDisabled(), true);
});

for (const [name, stop] of [
  ["the button", (tab) => button(tab, "STOP").click()],
  ["Escape", (tab) => tab.keyboard.press("Escape")],
  ["Space", (tab) => tab.keyboard.press("Space")],
  [
    "Escape in a text",
    async (tab) => {
      await tab.getByLabel("Search").focus();
      await tab.keyboard.press("Escape");
    },
  ],
]) {
  withTab(`${name} stops`, async ({ tab }) => {
    await run(tab);
    await stop(tab);
    await state(tab, "ready");
    await tab.getByText("· not armed").waitFor();
  });
}

withTab("a page that freezes leaves the drive at rest", async ({ tab }) => {
  await run(tab);
  await tab.evaluate(() => {
    const until = performance.now() + 3000;
    while (performance.now() < until);
  });
  await state(tab, "ready");
  await tab.getByText("the drive was stopped").waitFor();
});

withTab("a cold drive aligns when it is armed", async ({ tab }) => {
  await tab.getByLabel("rotor angles unknown").check();
  await button(tab, "Switch a new machine on").click();
  await state(tab, "unaligned");
  await button(tab, "Arm").click();
  await state(tab, "aligning");
  await state(tab, "ready", 30_000);
});

withTab("a fault shows its cause, and a reset leaves it", async ({ tab }) => {
  await run(tab);
  await tab.getByLabel(/^Fault/).selectOption("driver-fault");
  await button(tab, "Inject").click();
  await state(tab, "fault");
  const alert = await tab.getByRole("alert").innerText();
  assert.ok(alert.length > 40, alert);
  await tab.getByLabel(/^Fault/).selectOption("clear");
  await button(tab, "Inject").click();
  await button(tab, "Reset fault").click();
  await state(tab, "ready");
});

withTab("a setting is found, changed and stored", async ({ tab }) => {
  await tab.getByLabel("Search").fill("speed_rad_s");
  const field = tab.getByLabel("tuning.speed_rad_s, rad/s");
  const old = await field.inputValue();
  await field.fill(String(Number(old) + 10));
  await button(tab, "Set 1 changed").click();
  await button(tab, "Set").click();
  await button(tab, "Set 0 changed").waitFor();
  assert.equal(await field.inputValue(), String(Number(old) + 10));
});

withTab("a value that a setting cannot have is refused with a sentence", async ({ tab }) => {
  await tab.getByLabel("Search").fill("speed_rad_s");
  await tab.getByLabel("tuning.speed_rad_s, rad/s").fill("-5");
  await button(tab, "Set 1 changed").click();
  await button(tab, "Set").click();
  await tab.locator(".notice", { hasText: "speed_rad_s" }).waitFor();
});

withTab("the first visit: ripple falls, an effect is named, and its ripple is gone", async ({ tab }) => {
  const outcomes = [];
  for (const name of ["Run at 0 rpm", "Run at 500 rpm", "Add cogging", "Record and name it", "Compensate"]) {
    await button(tab, name).click();
    const step = tab.locator(".story li", { has: tab.locator("button", { hasText: name }) });
    const outcome = step.locator(".result", { hasText: /^(Ripple|cogging|No effect)/ });
    await outcome.waitFor({ timeout: 90_000 });
    outcomes.push(await outcome.innerText());
  }
  console.log(outcomes.join("\n"));
  const [single, double, cogging, , compensated] = outcomes.map((text) => Number.parseFloat(text.replace("Ripple ", "")));
  assert.ok(double < 0.2 * single, outcomes.join("; "));
  assert.match(outcomes[3], /^cogging, screw: .*order 12/);
  assert.ok(compensated < 0.3 * cogging, outcomes.join("; "));
});

withTab("a gain changes while the drive runs, and its predicted margin with it", async ({ tab }) => {
  await run(tab);
  const row = tab.getByRole("row", { name: /^screw, speed/ });
  const margin = async () => Number.parseFloat(await row.locator("td").nth(1).innerText());
  const before = await margin();
  assert.ok(before > 20 && before < 90, `${before} degrees`);
  const slider = tab.getByLabel("Cutoff of the speed loops");
  await slider.focus();
  for (let k = 0; k < 10; k++) await tab.keyboard.press("ArrowRight");
  const after = await margin();
  assert.ok(after < before - 1, `${before} to ${after} degrees`);
  await button(tab, "Set 1 changed").click();
  await button(tab, "Set").click();
  await button(tab, "Set 0 changed").waitFor();
  assert.equal(await margin(), after);
  await state(tab, "running");
  const unstored = tab.getByText("stores them when it is at rest");
  await unstored.waitFor();
  await button(tab, "STOP").click();
  await unstored.waitFor({ state: "detached" });
});

withTab("the loops are measured by steps beside their model, and the drive rests afterwards", async ({ tab }) => {
  const panel = tab.getByRole("region", { name: "Commissioning" });
  assert.equal(await button(tab, "Measure the loops").isDisabled(), true);
  await panel.getByLabel("The table may move").press("Enter");
  await button(tab, "Measure the loops").press("Enter");
  await panel.getByText("All steps are done").waitFor({ timeout: 60_000 });
  await state(tab, "ready");
  const loops = [["Current", 8, 300, 5], ["Speed", 48, 40, 8]].flatMap(([kind, steps, least, off]) =>
    ["screw", "nut"].map((motor) => [`${kind} loop of the ${motor}`, steps, least, off]),
  );
  for (const [name, steps, least, off] of loops) {
    const loop = panel.getByRole("region", { name });
    await loop.getByText(`${name}: ${steps} steps from`).waitFor();
    const values = async (name) => {
      const cells = await loop.getByRole("row", { name }).getByRole("cell").allInnerTexts();
      return cells.map((text) => Number.parseFloat(text));
    };
    const [[hz, degrees], [modelHz, modelDegrees]] = [await values("measured"), await values("model")];
    assert.ok(modelHz > least && Math.abs(hz / modelHz - 1) < 0.1, `${name}: ${hz} Hz measured, ${modelHz} Hz of the model`);
    assert.ok(Math.abs(degrees - modelDegrees) < off, `${name}: ${degrees} and ${modelDegrees} degrees`);
    for (const name of ["Step response", "Measured gain", "Measured phase"]) await loop.getByRole("img", { name }).waitFor();
  }
  // The page has its own telemetry again.
  await run(tab);
});

withTab("a stop ends a commissioning, which nothing else moves", async ({ tab }) => {
  const panel = tab.getByRole("region", { name: "Commissioning" });
  await panel.getByLabel("The table may move").press("Enter");
  await button(tab, "Commission").press("Enter");
  await panel.getByText("electrical: both motors turn").waitFor({ timeout: 30_000 });
  await state(tab, "running");
  await button(tab, "Run").click();
  await tab.getByText("The drive is being commissioned: stop it first.").waitFor();
  await tab.keyboard.press("Escape");
  await state(tab, "ready");
  await panel.getByText("It was stopped.").waitFor();
  await tab.getByText("· not armed").waitFor();
});

withTab("a burst shows every PWM period around its trigger, and its spectrum up to 10 kHz", async ({ tab }) => {
  const panel = tab.getByRole("region", { name: "Burst" });
  const says = (text) => panel.getByRole("status").filter({ hasText: text }).waitFor();
  await button(tab, "Read burst").click();
  await says("No burst was asked");
  await panel.getByLabel("Begins with").selectOption("level");
  await panel.getByLabel("Burst signal").selectOption("iq_ref_a");
  await panel.getByLabel("Burst level").fill("0.05");
  await panel.getByLabel("Before the trigger, %").fill("50");
  await button(tab, "Begin burst").click();
  await says("waits for its trigger");
  await button(tab, "Begin burst").click();
  await says("Another burst waits");
  await button(tab, "Read burst").click();
  await says("waits for its trigger");
  assert.equal(await panel.getByRole("img").count(), 0);
  await run(tab);
  await says("complete");
  await panel.getByRole("img", { name: "Burst in A over s from the trigger" }).waitFor();
  await panel.getByRole("img", { name: "Amplitude in the burst in A over Hz" }).waitFor();
  const labels = async (chart) => (await panel.locator(".u-legend").nth(chart).innerText()).split("\n").join(" ");
  assert.match(await labels(0), /nut current of phase a/);
  await panel.getByLabel("Burst unit").selectOption("rpm");
  await panel.getByRole("img", { name: "Amplitude in the burst in rpm over Hz" }).waitFor();
  await button(tab, "End burst").click();
  await says("it was ended");
  await state(tab, "running");
});
