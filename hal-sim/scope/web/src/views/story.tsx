import { signal } from "@preact/signals";
import { STEPS, outcome, perform, running } from "../story";

const shown = signal(true);

export function Story() {
  if (!shown.value) return null;
  return (
    <section class="card story" aria-label="First visit">
      <div class="row">
        <h2>First visit: five steps</h2>
        <button type="button" onClick={() => (shown.value = false)}>Close</button>
      </div>
      <ol>
        {STEPS.map((step, index) => (
          <li key={step.title}>
            <h3>{index + 1}. {step.title}</h3>
            <p>{step.about}</p>
            <button type="button" disabled={running.value !== ""} onClick={() => perform(step)}>{step.button}</button>
            <p class="result" aria-live="polite">{outcome(step)}</p>
          </li>
        ))}
      </ol>
    </section>
  );
}
