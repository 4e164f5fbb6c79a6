import { useEffect } from "preact/hooks";
import { stop } from "../drive";

const isText = (target: EventTarget | null) =>
  target instanceof HTMLTextAreaElement || (target instanceof HTMLInputElement && ["text", "number", "search"].includes(target.type));
const isCheckbox = (target: EventTarget | null) => target instanceof HTMLInputElement && target.type === "checkbox";

/** Escape stops from anywhere, Space from anywhere but a text. */
export function useStopKeys() {
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      // Space is the stop's, so Enter changes a checkbox.
      if (event.key === "Enter" && isCheckbox(event.target)) (event.target as HTMLInputElement).click();
      const space = event.key === " " && !isText(event.target);
      if (event.key !== "Escape" && !space) return;
      event.preventDefault();
      event.stopPropagation();
      stop();
    };
    // Before any control sees the key: Enter presses a button, Space stops.
    addEventListener("keydown", pressed, true);
    const released = (event: KeyboardEvent) => {
      if (event.key === " " && !isText(event.target)) event.preventDefault();
    };
    addEventListener("keyup", released, true);
    return () => {
      removeEventListener("keydown", pressed, true);
      removeEventListener("keyup", released, true);
    };
  }, []);
}

export function StopButton() {
  return (
    <button type="button" class="stop" onClick={stop} title="Escape or Space">
      STOP
    </button>
  );
}
