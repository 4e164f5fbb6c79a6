import { notice } from "../drive";
import { sentenceOf } from "../format";
import { compensate, compensation, doing, found, recordAndIdentify } from "../identification";
import type { FoundEffect } from "../messages";
import { lostInRestart } from "../settings";

const shown = (error: unknown) => notice(sentenceOf(error));

/** An effect with its parameters and their 95 % intervals. */
export function effectSentence(effect: FoundEffect): string {
  const values = Object.entries(effect.parameters).map(([name, value]) => {
    const interval = effect.interval[name];
    const unit = effect.unit[name] ?? "";
    const range = interval ? ` (${interval[0].toPrecision(3)} to ${interval[1].toPrecision(3)})` : "";
    return `${name} ${value.toPrecision(4)}${range} ${unit}`.trimEnd();
  });
  return `${effect.kind.replaceAll("_", " ")}, ${effect.where}: ${values.join("; ")}`;
}

function Report() {
  const report = found.value?.report;
  if (!report) return null;
  return (
    <>
      <p><strong>{report.verdict}</strong>: {report.summary}</p>
      <ul>{report.effects.map((effect) => <li key={effectSentence(effect)}>{effectSentence(effect)}</li>)}</ul>
      <details>
        <summary>Residual of the check run, before and after</summary>
        <table>
          <thead><tr><th>channel</th><th>before</th><th>after</th><th>noise</th></tr></thead>
          <tbody>
            {report.residual.map((one) => (
              <tr key={one.channel}>
                <th scope="row">{one.channel}, {one.unit}</th>
                <td>{one.check_before.toPrecision(3)}</td>
                <td>{one.check_after.toPrecision(3)}</td>
                <td>{one.noise_floor.toPrecision(3)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </details>
    </>
  );
}

export function Identification() {
  const settings = Object.keys(compensation.value?.settings ?? {});
  return (
    <section class="card">
      <h2>Identification</h2>
      <p class="muted">The drive runs through ten speeds for 18 s. The page compares both recordings with the model.</p>
      <button type="button" disabled={doing.value !== ""} onClick={() => recordAndIdentify().catch(shown)}>Record and identify</button>
      <p aria-live="polite">{doing.value}</p>
      <Report />
      {settings.length > 0 && (
        <>
          <p class="muted">
            {settings.length} settings compensate the model. The drive restarts for them and loses: {lostInRestart().join("; ")}.
            {compensation.value!.not_compensated.length > 0 && ` Not compensated: ${compensation.value!.not_compensated.join("; ")}.`}
          </p>
          <button type="button" disabled={doing.value !== ""} onClick={() => compensate().catch(shown)}>Compensate and restart</button>
        </>
      )}
    </section>
  );
}
