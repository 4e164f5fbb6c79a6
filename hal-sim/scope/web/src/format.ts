/** A number with so many digits after its point, and its unit. */
export function quantity(value: number | null | undefined, unit: string, digits = 2): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return `– ${unit}`;
  return `${value.toFixed(digits)} ${unit}`;
}

/** What an error says. */
export function sentenceOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
