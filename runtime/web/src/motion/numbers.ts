import { clamp } from "./springs.js";

/** Their sum, from the first on. */
export function sumOf(values: number[]): number {
  return values.reduce((sum, value) => sum + value, 0);
}

/** The largest, also of more numbers than a function takes. */
export function most(values: number[] | Float64Array): number {
  return (values as number[]).reduce((a, b) => Math.max(a, b));
}

export function least(values: number[] | Float64Array): number {
  return (values as number[]).reduce((a, b) => Math.min(a, b));
}

/** The places of values, that of the largest first; of equal ones in their order. */
export function ranked(values: ArrayLike<number>): number[] {
  return Array.from(values, (_, at) => at).sort((a, b) => values[b]! - values[a]! || a - b);
}

/** How often each value comes. */
export function counted(values: Iterable<string>): Map<string, number> {
  const counts = new Map<string, number>();
  for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
  return counts;
}

/** The difference of the largest and the least number. */
export function spread(values: number[]): number {
  let least = Infinity;
  let most = -Infinity;
  for (const value of values) {
    least = Math.min(least, value);
    most = Math.max(most, value);
  }
  return most - least;
}

/** That of places along x, y and z. */
export function extents(places: number[][]): [x: number, y: number, z: number] {
  const along = (axis: number) => spread(places.map((place) => place[axis]!));
  return [along(0), along(1), along(2)];
}

/** The value that a share (0 to 1) of the values lies below, between two of them on a line. */
export function quantile(values: number[], share: number): number {
  const sorted = Float64Array.from(values).sort();
  const at = share * (sorted.length - 1);
  const low = Math.floor(at);
  return sorted[low]! + (at - low) * (sorted[Math.min(low + 1, sorted.length - 1)]! - sorted[low]!);
}

export function median(values: number[]): number {
  return quantile(values, 0.5);
}

/** The nearest whole number, of two the even one, as in Python. */
export function rounded(value: number): number {
  const nearest = Math.round(value);
  return Math.abs(value - Math.trunc(value)) === 0.5 && nearest % 2 ? nearest - 1 : nearest;
}

/** Smoothly from 0 at `start` to 1 at `end` (Perlin's "smootherstep", 2002). */
export function rise(value: number, start: number, end: number): number {
  const part = clamp((value - start) / Math.max(end - start, 1e-12), 0, 1);
  return part ** 3 * (10 - 15 * part + 6 * part ** 2);
}

/** The cubic Hermite curve from one value to another, at a part of the way: with slopes there and here, over the whole way. */
export function hermite(start: number, leaves: number, end: number, arrives: number, part: number): number {
  const left = 1 - part;
  return (
    (1 + 2 * part) * left ** 2 * start +
    part * left ** 2 * leaves +
    part ** 2 * (3 - 2 * part) * end -
    part ** 2 * left * arrives
  );
}

/** Numbers by row smoothed by a Gaussian window of so many rows' deviation; at both ends their mirror images in them go on. */
export function smoothed(rows: number[][], deviation: number): number[][] {
  const reach = rounded(3 * deviation);
  const last = rows.length - 1;
  if (last < 1 || !reach) return rows;
  const window = Array.from({ length: 2 * reach + 1 }, (_, at) =>
    Math.exp(-0.5 * ((at - reach) / deviation) ** 2),
  );
  const total = sumOf(window);
  const value = (row: number, column: number): number =>
    row < 0
      ? 2 * rows[0]![column]! - value(-row, column)
      : row > last
        ? 2 * rows[last]![column]! - value(2 * last - row, column)
        : rows[row]![column]!;
  return rows.map((values, row) =>
    values.map(
      (_, column) =>
        window.reduce((sum, weight, at) => sum + weight * value(row + at - reach, column), 0) / total,
    ),
  );
}

/** Each value's window of `reach` values before and as many after; those at the ends go on. */
export function windows(values: number[], reach: number): number[][] {
  const value = (at: number) => values[clamp(at, 0, values.length - 1)]!;
  return values.map((_, at) => Array.from({ length: 2 * reach + 1 }, (_, step) => value(at + step - reach)));
}
