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
