import { signal } from "@preact/signals";
import { injections } from "scope";
import { choose, connection, notice, source, tell } from "../drive";
import type { Injection } from "../messages";
import { EFFECTS } from "./effects";

const SERIAL_BAUD = 4_000_000;

const board = signal("mains");
const cold = signal(false);
const effects = signal("");
const fault = signal("load");
const motor = signal(0);
const amount = signal(0);

interface Serial {
  requestPort(): Promise<unknown>;
}

async function connectBoard() {
  try {
    await (navigator as unknown as { serial: Serial }).serial.requestPort();
    choose({ kind: "serial", baud: SERIAL_BAUD });
  } catch {
    notice("No serial port was chosen.");
  }
}

export const restart = () => choose({ kind: "simulation", board: board.value, cold: cold.value, effects: effects.value });

function Restart() {
  return (
    <>
      <div class="row">
        <label>
          Board{" "}
          <select value={board.value} onChange={(event) => (board.value = event.currentTarget.value)}>
            {["mains", "nucleo", "paper"].map((one) => <option key={one}>{one}</option>)}
          </select>
        </label>
        <label><input type="checkbox" checked={cold.value} onChange={() => (cold.value = !cold.value)} /> rotor angles unknown</label>
      </div>
      <label>
        Effect{" "}
        <select onChange={(event) => (effects.value = EFFECTS[event.currentTarget.selectedIndex]?.toml ?? "")}>
          {EFFECTS.map((one) => <option key={one.name}>{one.name}</option>)}
        </select>
      </label>
      <label class="block">
        Effects of the machine, as TOML
        <textarea rows={5} value={effects.value} onInput={(event) => (effects.value = event.currentTarget.value)} />
      </label>
      <button type="button" onClick={restart}>Switch a new machine on</button>
    </>
  );
}

function Faults() {
  const all = JSON.parse(injections()) as Injection[];
  const one = all.find((other) => other.name === fault.value) ?? all[0]!;
  const inject = () => tell({ command: "inject", fault: one.name, motor: motor.value, amount: one.range ? amount.value : 0 });
  return (
    <>
      <h3>Faults of the simulated machine</h3>
      <div class="row">
        <label>
          Fault{" "}
          <select value={one.name} onChange={(event) => (fault.value = event.currentTarget.value)}>
            {all.map((other) => <option key={other.name}>{other.name}</option>)}
          </select>
        </label>
        {one.motor && (
          <label>
            Motor{" "}
            <select value={motor.value} onChange={(event) => (motor.value = Number(event.currentTarget.value))}>
              <option value={0}>screw</option>
              <option value={1}>nut</option>
            </select>
          </label>
        )}
        {one.range && (
          <label>
            Amount, {one.unit}{" "}
            <input type="number" step="any" min={one.range[0]} max={one.range[1]} value={amount.value} onInput={(event) => (amount.value = event.currentTarget.valueAsNumber || 0)} />
          </label>
        )}
        <button type="button" onClick={inject}>Inject</button>
      </div>
      <p class="muted">{one.sentence}</p>
    </>
  );
}

export function Simulation() {
  return (
    <section class="card">
      <h2>Drive</h2>
      {"serial" in navigator && <button type="button" onClick={connectBoard}>Connect a board</button>}
      {source.value?.kind === "simulation" && <Restart />}
      {source.value?.kind !== "simulation" && <button type="button" onClick={restart}>Simulate a drive in this page</button>}
      {connection.value.simulated && <Faults />}
    </section>
  );
}
