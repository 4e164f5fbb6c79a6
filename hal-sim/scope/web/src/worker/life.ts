// Whether the page is alive. A page that is frozen or gone must not keep the machine moving.

/** The page sends a sign each 100 ms. A hidden page's timers run once a second. */
const VISIBLE_MS = 500;
const HIDDEN_MS = 2000;

export class Life {
  private last = performance.now();
  private hidden = false;

  sign(hidden: boolean) {
    this.last = performance.now();
    this.hidden = hidden;
  }

  get missing(): boolean {
    return performance.now() - this.last > (this.hidden ? HIDDEN_MS : VISIBLE_MS);
  }
}
