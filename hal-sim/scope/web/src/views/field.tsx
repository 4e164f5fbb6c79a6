import type { Signal } from "@preact/signals";
import { useId } from "preact/hooks";

interface FieldProps {
  label: string;
  unit: string;
  value: Signal<number>;
  low: number;
  high: number;
  step: number;
}

/** A number with a slider. */
export function Field({ label, unit, value, low, high, step }: FieldProps) {
  const id = useId();
  const take = (event: Event) => {
    const number = (event.currentTarget as HTMLInputElement).valueAsNumber;
    if (Number.isFinite(number)) value.value = number;
  };
  return (
    <div class="field">
      <label for={id}>{label}</label>
      <input type="range" min={low} max={high} step={step} value={value.value} onInput={take} aria-label={`${label}, slider`} />
      <input id={id} type="number" min={low} max={high} step={step} value={value.value} onInput={take} />
      <span class="unit">{unit}</span>
    </div>
  );
}
