// Opens the built page in Debian's Chromium. SCOPE_PAGE is the page's file, CHROMIUM another browser's program.
import { chromium } from "playwright-core";
import { pathToFileURL } from "node:url";

const page = process.env.SCOPE_PAGE;
if (!page) throw new Error("SCOPE_PAGE is not set: run `cargo xtask page --test`");

const options = { executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] };

export const launch = () => chromium.launch(options);

/** A browser whose process can be killed, and the way to it. */
export const launchServer = () => chromium.launchServer(options);
export const chromiumAt = (server) => chromium.connect(server.wsEndpoint());

/** A tab with the page, once the drive has this state: its errors and the requests that left it are kept. */
export async function open(browser, settings = {}, address = pathToFileURL(page).href, first = "ready") {
  const context = await browser.newContext(settings);
  const tab = await context.newPage();
  const errors = [];
  const requests = [];
  tab.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  tab.on("pageerror", (error) => errors.push(String(error)));
  tab.on("request", (request) => requests.push(request.url()));
  await tab.goto(address);
  await state(tab, first);
  return { tab, errors, requests, context };
}

/** Waits for a state of the drive. */
export async function state(tab, name, timeout = 20_000) {
  try {
    await tab.locator("#state", { hasText: new RegExp(`^${name}$`) }).waitFor({ timeout });
  } catch (error) {
    const shown = await tab.locator("header, .notices, [role=alert]").allInnerTexts();
    throw new Error(`The drive did not become ${name}: ${shown.join("; ")}`, { cause: error });
  }
}

export const button = (tab, name) => tab.getByRole("button", { name, exact: true });

/** Arms and runs at the speeds that are set. */
export async function run(tab) {
  await button(tab, "Arm").click();
  await tab.getByText("· armed").waitFor();
  await button(tab, "Run").click();
  await state(tab, "running");
}
