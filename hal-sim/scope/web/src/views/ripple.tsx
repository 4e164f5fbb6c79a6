import { quantity } from "../format";
import { before, now, type Ripple } from "../ripple";

function Line(props: { name: string; ripple: Ripple }) {
  const { vrf_percent, rms_percent, bandwidth_hz, mean_mm_s } = props.ripple;
  return (
    <tr>
      <th scope="row">{props.name}</th>
      <td>{quantity(vrf_percent, "%")}</td>
      <td>{quantity(rms_percent, "%", 3)}</td>
      <td>{quantity(mean_mm_s, "mm/s", 3)}</td>
      <td>{quantity(bandwidth_hz, "Hz", 0)}</td>
    </tr>
  );
}

export function RippleTable() {
  const last = now.value;
  const measured = typeof last !== "string";
  return (
    <section class="card">
      <h2>Velocity ripple</h2>
      <table>
        <thead>
          <tr><th>2 s</th><th>VRF (Eq 19)</th><th>rms</th><th>mean</th><th>bandwidth</th></tr>
        </thead>
        <tbody>
          {measured ? <Line name="now" ripple={last} /> : <tr><th scope="row">now</th><td colSpan={4}>{last}</td></tr>}
          {before.value && <Line name="before" ripple={before.value} />}
        </tbody>
      </table>
      <div class="row">
        <button type="button" disabled={!measured} onClick={() => { if (measured) before.value = last; }}>Keep as before</button>
        <button type="button" disabled={!before.value} onClick={() => { before.value = null; }}>Forget before</button>
      </div>
      <p class="muted">VRF is the velocity ripple factor: peak to peak over mean. The table's scale measures it, its noise included.</p>
    </section>
  );
}
