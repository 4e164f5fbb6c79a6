import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";

/** Frames in the last second. */
const rate = signal(0);

export function FrameRate() {
  useEffect(() => {
    let frames = 0;
    let begun = performance.now();
    let request = 0;
    const count = () => {
      frames++;
      const now = performance.now();
      if (now - begun >= 1000) {
        rate.value = (frames * 1000) / (now - begun);
        [frames, begun] = [0, now];
      }
      request = requestAnimationFrame(count);
    };
    request = requestAnimationFrame(count);
    return () => cancelAnimationFrame(request);
  }, []);
  return <span class="muted" id="frame-rate">{rate.value.toFixed(0)} frames/s</span>;
}
