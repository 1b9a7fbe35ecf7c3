/* Critically damped springs: a distance from rest and its rate, some seconds later (docs/reference/bundle.md, the loop `matching`). */

/** The damping, 1/s, of a spring of about this half-life in seconds. */
export function dampingOf(halfLife: number): number {
  return (2 * Math.LN2) / halfLife;
}

export function damped(
  off: number,
  rate: number,
  damping: number,
  seconds: number,
): [off: number, rate: number] {
  const rise = (rate + damping * off) * seconds;
  const left = Math.exp(-damping * seconds);
  return [(off + rise) * left, (rate - damping * rise) * left];
}

/** Distances from rest and their rates, some seconds later, in place. */
export function damp(off: Float64Array, rate: Float64Array, damping: number, seconds: number): void {
  const left = Math.exp(-damping * seconds);
  for (let i = 0; i < off.length; i++) {
    const rise = (rate[i]! + damping * off[i]!) * seconds;
    off[i] = (off[i]! + rise) * left;
    rate[i] = (rate[i]! - damping * rise) * left;
  }
}

/** The integral of the distance over those seconds. */
export function dampedPath(off: number, rate: number, damping: number, seconds: number): number {
  const rise = rate / damping + off;
  const left = Math.exp(-damping * seconds);
  return (rise + off - left * (rise + off + rise * damping * seconds)) / damping;
}

/** An angle between -pi and pi. */
export function wrapped(angle: number): number {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
