import { signal } from "@preact/signals";
import { connection, notice, status, stop, stops } from "../drive";
import { quantity } from "../format";
import { before, measure, type Ripple } from "../ripple";
import { change, held } from "../settings";
import { arm, commonSpeed, run, tableSpeed } from "./commands";

const LEARNING = "compensation.learning_s";
const shown = signal(true);
const doing = signal("");

interface Step {
  title: string;
  about: string;
  button: string;
  rpm: number;
  learns: boolean;
  /** Seconds from the start of the run to the measurement. */
  seconds: number;
}

const STEPS: Step[] = [
  { title: "Single drive", about: "Only the screw turns. It is slow, so the table shows the ripple of its torque.", button: "Run at 0 rpm", rpm: 0, learns: false, seconds: 4 },
  { title: "Double drive", about: "Both motors turn fast. The table moves with the difference.", button: "Run at 500 rpm", rpm: 500, learns: false, seconds: 5 },
  { title: "Learned", about: "The drive learns what repeats with the angles, and compensates it.", button: "Learn, and run", rpm: 500, learns: true, seconds: 14 },
];

const results = signal<(Ripple | null)[]>(STEPS.map(() => null));

const wait = (ms: number) => new Promise((done) => setTimeout(done, ms));

/** Waits for a state of the drive; it throws if that does not come. */
async function reached(what: string, holds: () => boolean, seconds: number) {
  const begun = stops.value;
  for (let tenth = 0; tenth < 10 * seconds; tenth++) {
    if (holds()) return;
    if (stops.value !== begun) throw new Error("A stop ended this step.");
    await wait(100);
  }
  throw new Error(`The drive did not become ${what}.`);
}

const is = (...states: string[]) => connection.value.open && states.includes(status.value?.state ?? "");

async function learn(on: boolean) {
  const now = Number(held.value.get(LEARNING) ?? 0) > 0;
  if (now === on) return;
  if (!is("ready", "unaligned")) stop();
  await reached("ready", () => is("ready", "unaligned"), 20);
  if (!(await change(new Map([[LEARNING, on ? "0.5" : "0"]])))) throw new Error("The setting was not taken.");
  // The drive restarts, and the page reads its settings again.
  await reached("ready", () => is("ready", "unaligned") && Number(held.value.get(LEARNING)) > 0 === on, 20);
}

async function perform(index: number) {
  const step = STEPS[index]!;
  doing.value = step.title;
  try {
    await learn(step.learns);
    await reached("ready", () => is("ready", "unaligned", "running", "holding"), 20);
    if (!status.value?.armed && !(await arm())) return;
    await reached("armed", () => status.value?.armed === true && is("ready", "running", "holding"), 20);
    [tableSpeed.value, commonSpeed.value] = [2.5, step.rpm];
    const begun = stops.value;
    if (!(await run())) return;
    for (let second = 0; second < step.seconds; second++) {
      await wait(1000);
      if (stops.value !== begun) throw new Error("A stop ended this step.");
    }
    const ripple = measure(2);
    if (typeof ripple === "string") throw new Error(ripple);
    results.value = results.value.map((old, k) => (k === index ? ripple : old));
    if (index === 0) before.value = ripple;
  } catch (error) {
    notice(error instanceof Error ? error.message : String(error));
  } finally {
    doing.value = "";
  }
}

export function Story() {
  if (!shown.value) return null;
  return (
    <section class="card story" aria-label="First visit">
      <div class="row">
        <h2>First visit</h2>
        <button type="button" onClick={() => (shown.value = false)}>Close</button>
      </div>
      <ol>
        {STEPS.map((step, index) => {
          const result = results.value[index];
          return (
            <li key={step.title}>
              <h3>{index + 1}. {step.title}</h3>
              <p>{step.about}</p>
              <button type="button" disabled={doing.value !== ""} onClick={() => perform(index)}>{step.button}</button>
              <p class="result" aria-live="polite">
                {doing.value === step.title ? `Measuring, ${step.seconds} s.` : result ? `Ripple ${quantity(result.vrf_percent, "%", 1)}` : "Not measured yet."}
              </p>
            </li>
          );
        })}
      </ol>
    </section>
  );
}
