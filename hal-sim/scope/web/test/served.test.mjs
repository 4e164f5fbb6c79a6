// The page at `ddfeed scope`: a second page, a reload, a line that stalls, and programs that are killed.
import { after, before, test } from "node:test";
import { button, launch, open, run, state } from "../browser.mjs";
import { program, Served } from "../served.mjs";

let browser;
before(async () => (browser = await launch()));
after(async () => browser?.close());

/** A test with a served drive and a page. */
const withDrive = (name, body, settings = []) =>
  test(name, { timeout: 120_000, skip: program ? false : "DDFEED is not set: it is the program `ddfeed` with all features" }, async () => {
    const served = new Served();
    const tabs = [];
    try {
      await served.start();
      if (settings.length) await served.command("settings", "set", ...settings);
      const openTab = async (first = "ready") => {
        const opened = await open(browser, {}, served.address, first);
        tabs.push(opened);
        return opened.tab;
      };
      await body({ served, openTab, tab: await openTab() });
    } finally {
      for (const { context } of tabs) await context.close();
      await served.end();
    }
  });

const armed = (tab) => tab.getByText("· armed");
const atRest = (tab) => tab.getByText("· not armed");

withDrive("a second page watches, cannot command, and may stop", async ({ tab, openTab }) => {
  await run(tab);
  const second = await openTab("running");
  await button(second, "Run").click();
  await second.locator(".notice").waitFor();
  await state(second, "running");
  await button(second, "STOP").click();
  await state(tab, "ready");
  await atRest(tab).waitFor();
  // To open a page may take a busy computer longer than the usual heartbeat.
}, ["command.heartbeat_ms=10000"]);

// The browser may end the worker before its stop is sent: then the drive stops where the heartbeat is missing.
withDrive("a page that is reloaded while the drive moves leaves it at rest", async ({ tab }) => {
  await run(tab);
  await tab.reload();
  await state(tab, "(ready|fault)");
  await new Promise((resolve) => setTimeout(resolve, 1000));
  const reset = button(tab, "Reset fault");
  if (await reset.isEnabled()) await reset.click();
  await state(tab, "ready");
  await atRest(tab).waitFor();
  await run(tab);
});

withDrive("a page that is closed while the drive moves leaves it at rest", async ({ tab, openTab }) => {
  const watcher = await openTab();
  await run(tab);
  await state(watcher, "running");
  await tab.close();
  await state(watcher, "ready", 2000);
});

withDrive("a commissioning goes on over the drive's restarts", async ({ tab }) => {
  const panel = tab.getByRole("region", { name: "Commissioning" });
  await panel.getByLabel("The table may move").press("Enter");
  await button(tab, "Commission").press("Enter");
  // Two steps have stored their values, and the drive has restarted after each.
  await panel.getByText("angle: both motors turn").waitFor({ timeout: 60_000 });
  await state(tab, "running");
  await tab.keyboard.press("Escape");
  await state(tab, "ready");
  await panel.getByText("It was stopped.").waitFor();
});

withDrive("a line that stalls for 2 s ends in rest, and goes on", async ({ served, tab }) => {
  await run(tab);
  served.line.stall(true);
  await tab.locator("header", { hasText: "does not answer" }).waitFor({ timeout: 2000 });
  await new Promise((resolve) => setTimeout(resolve, 2000));
  served.line.stall(false);
  await state(tab, "fault");
  await tab.locator(".fault", { hasText: "command" }).waitFor();
  await button(tab, "Reset fault").click();
  await state(tab, "ready");
  await run(tab);
});

withDrive("a drive that is killed is shown as gone, and as back after its restart", async ({ served, tab }) => {
  await run(tab);
  await served.drive.kill();
  await state(tab, "not connected");
  await served.drive.start();
  await state(tab, "ready");
  await armed(tab).waitFor({ state: "detached" });
  await run(tab);
});

withDrive("`ddfeed scope` that is killed leaves the drive at rest, and the page finds it again", async ({ served, tab }) => {
  await run(tab);
  await served.scope.kill();
  await state(tab, "not connected");
  await served.scope.start();
  await state(tab, "fault");
  await button(tab, "Reset fault").click();
  await state(tab, "ready");
  await run(tab);
});
