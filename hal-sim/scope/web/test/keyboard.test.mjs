import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, open, state } from "../browser.mjs";

let browser;
before(async () => (browser = await launch()));
after(async () => browser?.close());

/** Buttons that other tests press: they change the machine or take a while. */
const LEFT_OUT = /^(Run at|Add cogging|Record and name it|Compensate|Record|Switch a new machine on|Connect a board|Identify)/;
const MOST_STOPS = 1500;

/** What has the focus. */
const focused = (tab) =>
  tab.evaluate(() => {
    const one = document.activeElement;
    if (!one || one === document.body) return null;
    const visited = one.dataset.visited === "yes";
    one.dataset.visited = "yes";
    const outline = getComputedStyle(one);
    return {
      visited,
      tag: one.tagName.toLowerCase(),
      type: one.type ?? "",
      name: one.textContent?.trim() ?? "",
      value: one.type === "checkbox" ? String(one.checked) : (one.value ?? ""),
      options: one.options?.length ?? 0,
      open: one.parentElement?.open ?? null,
      inTree: Boolean(one.closest(".tree")),
      marked: outline.outlineStyle !== "none" && Number.parseFloat(outline.outlineWidth) > 0,
    };
  });

/** Goes on with Tab to a control whose text begins so. */
async function tabTo(tab, name) {
  for (let k = 0; k < MOST_STOPS; k++) {
    await tab.keyboard.press("Tab");
    if ((await focused(tab))?.name.startsWith(name)) return;
  }
  assert.fail(`Tab does not reach ${name}.`);
}

/** Presses the keys, and expects another value after each. */
async function changes(tab, one, ...keys) {
  let last = one.value;
  for (const key of keys) {
    await tab.keyboard.press(key);
    const next = (await focused(tab))?.value;
    assert.notEqual(next, last, `${key} does not change ${one.tag} ${one.type} ${one.name}`);
    last = next;
  }
}

async function use(tab, one) {
  if (one.tag === "summary") {
    // One group of settings stands for all: they are several hundred alike.
    if (!one.open && !one.inTree) await tab.keyboard.press("Enter");
  } else if (one.tag === "select") {
    if (one.options > 1) await changes(tab, one, ...(await tab.evaluate(() => (document.activeElement.selectedIndex === 0 ? ["ArrowDown", "ArrowUp"] : ["ArrowUp", "ArrowDown"]))));
  } else if (one.type === "checkbox") {
    await changes(tab, one, "Enter", "Enter");
  } else if (one.type === "range") {
    const atTop = await tab.evaluate(() => document.activeElement.value === document.activeElement.max);
    await changes(tab, one, ...(atTop ? ["ArrowLeft", "ArrowRight"] : ["ArrowRight", "ArrowLeft"]));
  } else if (["text", "search"].includes(one.type) || one.tag === "textarea") {
    await tab.keyboard.press("End");
    await changes(tab, one, "1", "Backspace");
  } else if (one.type === "number") {
    const atTop = await tab.evaluate(() => document.activeElement.value === document.activeElement.max);
    await changes(tab, one, ...(atTop ? ["ArrowDown", "ArrowUp"] : ["ArrowUp", "ArrowDown"]));
  } else if (one.tag === "button" && one.name !== "STOP" && !LEFT_OUT.test(one.name)) {
    await tab.keyboard.press("Enter");
  }
}

/** Goes once through the page with Tab, and uses each control that was not visited: how many stops there were. */
async function tour(tab) {
  for (let stops = 0; stops < MOST_STOPS; stops++) {
    await tab.keyboard.press("Tab");
    const one = await focused(tab);
    if (!one) return stops;
    assert.ok(one.marked, `the focus of ${one.tag} ${one.name} is not marked`);
    if (!one.visited) await use(tab, one);
  }
  return MOST_STOPS;
}

/** Controls that Tab has not reached. */
const unvisited = (tab) =>
  tab.evaluate(() =>
    [...document.querySelectorAll("button, input, select, textarea, summary")]
      .filter((one) => !one.disabled && !one.dataset.visited && one.checkVisibility())
      .map((one) => `${one.tagName} ${one.type ?? ""} ${one.textContent.trim()}`),
  );

test("every control works by keyboard alone", { timeout: 300_000 }, async () => {
  const { tab, errors } = await open(browser);
  const stops = await tour(tab);
  assert.ok(stops > 40, `${stops} controls`);
  assert.ok(stops < MOST_STOPS, "Tab does not leave the page");
  // A reply of the drive may add a notice before the place of the focus: the next tour reaches its button.
  let missed = await unvisited(tab);
  for (let tours = 1; missed.length > 0 && tours < 3; tours++) {
    await tour(tab);
    missed = await unvisited(tab);
  }
  assert.deepEqual(missed, []);
  assert.deepEqual(errors, []);
});

test("a drive is armed, runs and stops by keyboard alone", { timeout: 60_000 }, async () => {
  const { tab } = await open(browser);
  await tabTo(tab, "Arm");
  await tab.keyboard.press("Enter");
  await tab.getByText("· armed").waitFor();
  await tabTo(tab, "Run");
  await tab.keyboard.press("Enter");
  await state(tab, "running");
  await tab.keyboard.press("Space");
  await state(tab, "ready");
});
