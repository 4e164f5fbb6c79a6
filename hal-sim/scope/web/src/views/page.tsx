import { dismiss, notices, source } from "../drive";
import { BurstPanel } from "./burst";
import { Commands } from "./commands";
import { CommissioningPanel } from "./commissioning";
import { Faults } from "./faults";
import { Header } from "./header";
import { Identification } from "./identification";
import { LoopMargins } from "./loops";
import { MachinePicture } from "./machine";
import { Plots } from "./plots";
import { RippleTable } from "./ripple";
import { SettingsTree } from "./settings";
import { Simulation } from "./simulation";
import { Story } from "./story";
import { useStopKeys } from "./stop";

function Notices() {
  return (
    <div class="notices" role="status" aria-live="polite">
      {notices.value.map((sentence) => (
        <p class="notice" key={sentence}>
          {sentence} <button type="button" onClick={() => dismiss(sentence)}>Dismiss</button>
        </p>
      ))}
    </div>
  );
}

export function Page() {
  useStopKeys();
  return (
    <>
      <Header />
      <Notices />
      <main>
        {source.value?.kind === "simulation" && <Story />}
        <div class="columns">
          <section class="column" aria-label="Machine">
            <MachinePicture />
            <Faults />
            <Commands />
            <CommissioningPanel />
          </section>
          <section class="column wide" aria-label="Signals">
            <Plots />
            <BurstPanel />
            <RippleTable />
            <Identification />
          </section>
          <section class="column" aria-label="Settings">
            <LoopMargins />
            <SettingsTree />
            <Simulation />
          </section>
        </div>
      </main>
    </>
  );
}
