// The last seconds of telemetry, column by column.

/** Rows that are kept: 60 s at 1 kHz. */
const KEPT = 60_000;
/** Rows beyond those that are kept before the oldest are dropped at once. */
const SPARE = 10_000;

export class Rows {
  private readonly data: Float64Array[];
  private start = 0;
  private end = 0;

  constructor(readonly columns: number) {
    this.data = Array.from({ length: columns }, () => new Float64Array(KEPT + SPARE));
  }

  get length(): number {
    return this.end - this.start;
  }

  clear() {
    this.start = this.end = 0;
  }

  /** Appends rows of `columns` values each. */
  append(rows: Float64Array) {
    const count = Math.floor(rows.length / this.columns);
    for (let row = 0; row < count; row++) {
      if (this.end === KEPT + SPARE) this.compact();
      for (let column = 0; column < this.columns; column++) {
        this.data[column]![this.end] = rows[row * this.columns + column]!;
      }
      this.end++;
    }
    this.start = Math.max(this.start, this.end - KEPT);
  }

  private compact() {
    for (const column of this.data) column.copyWithin(0, this.start, this.end);
    this.end -= this.start;
    this.start = 0;
  }

  /** The last `count` values of a column, a view that lasts until the next append. */
  last(column: number, count: number): Float64Array {
    return this.data[column]!.subarray(Math.max(this.start, this.end - count), this.end);
  }

  /** Values of a column between two row numbers counted from the oldest. */
  range(column: number, from: number, to: number): Float64Array {
    return this.data[column]!.subarray(this.start + Math.max(0, from), this.start + Math.min(this.length, to));
  }
}
