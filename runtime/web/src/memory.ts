import type { NumberArray } from "./arrays.js";
import { BundleError } from "./errors.js";

/** Weights of the last step and those before it. */
const PAST = [1, 0.5, 0.25];
/** Places are drawn by exp(-distance / NEAR). */
const NEAR = 0.5;
/** What is added to a distance for each squared step of difference in age, and the most of it. */
const LATER = 1 / 64;
const LATEST = 2;
/** The share of a motion's movement in which an action is taken up that follows another. */
const EARLY = 0.3;
/** The share of a motion's movement that may be left out from one step to the next. */
const LEAP = 0.3;
/** What a step without movement counts beside the squared differences of codes' numbers. */
const REST = 0.125;
/** What the codes of a step count beside the squared differences of their numbers, where an act is looked for. */
const POSE = 1;
/** The share of the most that a number of steps can show from which on a start is as good. */
const GOOD = 0.95;

/** Remembered steps of codes: docs/bundle.md, the loop `codes`. */
export class Memory {
  readonly steps: number;
  readonly ages: Int32Array;
  private readonly parts: Float64Array;
  private readonly acts: Float64Array;
  private readonly lasts: Int32Array;
  /** Numbers of the codes of all steps, and how many a step has. */
  private readonly numbers: Float32Array;
  private readonly width: number;
  private readonly rows = new Map<number, number[]>();

  /** table: (M, P + 2) codes, action, age. moves: (E, 3). body: (V, L). actions: how many there are. */
  constructor(private readonly table: NumberArray, moves: NumberArray, body: NumberArray, actions: number) {
    const [steps, columns] = [table.shape[0]!, table.shape[1]!];
    this.steps = steps;
    this.width = moves.shape[1]! + (columns - 3) * body.shape[1]!;
    this.numbers = new Float32Array(steps * this.width);
    this.ages = Int32Array.from({ length: steps }, (_, row) => Number(table.data[(row + 1) * columns - 1]));
    for (let row = 0; row < steps; row++) this.remember(row, moves, body, actions);
    this.lasts = lastsOf(this.ages);
    const changes = this.changes(moves.shape[1]!, moves.shape[0]!);
    this.parts = this.over(changes.map((change) => REST + change));
    const rare = this.rarity(body.shape[0]!, moves.shape[0]!);
    this.acts = this.over(changes.map((change, row) => (POSE + change) * Math.exp(rare[row]!)));
  }

  /** How much the numbers of the body change before each step, squared; none before a motion's first and its end. */
  private changes(ways: number, end: number): Float64Array {
    const found = new Float64Array(this.steps);
    for (let row = 0; row < this.steps; row++) {
      for (let at = ways; at < this.width && this.ages[row]! > 0 && this.column(row, 0) !== end; at++) {
        found[row]! += (this.numbers[row * this.width + at]! - this.numbers[(row - 1) * this.width + at]!) ** 2;
      }
    }
    return found;
  }

  /** The share of what the steps of each motion count that is over before each step, 0 to 1. */
  private over(counts: Float64Array): Float64Array {
    const parts = new Float64Array(this.steps);
    for (let start = 0; start < this.steps; start = this.lasts[start]! + 1) {
      let over = 0;
      for (let row = start; row <= this.lasts[start]!; row++) {
        parts[row] = over;
        over += counts[row]!;
      }
      for (let row = start; row <= this.lasts[start]!; row++) parts[row]! /= Math.max(over, 1e-12);
    }
    return parts;
  }

  /**
   * How rare the body's codes of each step are among actions, in standard deviations: the sum of the logarithms of
   * inverse document frequencies. -Infinity for an end, which counts nothing.
   */
  private rarity(values: number, end: number): Float64Array {
    const columns = this.table.shape[1]!;
    const found = new Float64Array(this.steps);
    const real = [...found.keys()].filter((row) => this.column(row, 0) !== end);
    for (let column = 1; column < columns - 2; column++) {
      const has = Array.from({ length: values }, () => new Set<number>());
      for (const row of real) has[this.column(row, column)]!.add(this.column(row, columns - 2));
      for (const row of real) found[row]! += Math.log(this.rows.size / has[this.column(row, column)]!.size);
    }
    const mean = real.reduce((sum, row) => sum + found[row]!, 0) / real.length;
    const spread = Math.sqrt(real.reduce((sum, row) => sum + (found[row]! - mean) ** 2, 0) / real.length);
    const rare = new Float64Array(this.steps).fill(-Infinity);
    for (const row of real) rare[row] = (found[row]! - mean) / Math.max(spread, 1e-12);
    return rare;
  }

  private column(row: number, column: number): number {
    return Number(this.table.data[row * this.table.shape[1]! + column]);
  }

  private remember(row: number, moves: NumberArray, body: NumberArray, actions: number): void {
    const columns = this.table.shape[1]!;
    const at = (column: number) => Number(this.table.data[row * columns + column]);
    const [end, values] = [moves.shape[0]!, body.shape[0]!];
    const [move, action, age] = [at(0), at(columns - 2), this.ages[row]!];
    let fits = move >= 0 && move <= end && action >= 0 && action < actions && age >= 0 && age <= row;
    for (let column = 1; column < columns - 2; column++) fits &&= at(column) >= 0 && at(column) < values;
    if (!fits) throw new BundleError("table memory is out of range");
    const rows = this.rows.get(action);
    if (rows) rows.push(row);
    else this.rows.set(action, [row]);
    if (move === end) return; // its numbers are zeros
    let place = row * this.width;
    for (let column = 0; column < columns - 2; column++) {
      const { data, shape } = column ? body : moves;
      for (let i = 0; i < shape[1]!; i++) this.numbers[place++] = Number(data[at(column) * shape[1]! + i]);
    }
  }

  /** Whether anything of an action is remembered. */
  knows(action: number): boolean {
    return this.rows.has(action);
  }

  /** The codes (P) of a step. */
  codes(row: number): number[] {
    const columns = this.table.shape[1]!;
    return Array.from(this.table.data.subarray(row * columns, (row + 1) * columns - 2), Number);
  }

  /** The share of the movement of its motion that is over after a step. */
  after(row: number): number {
    return this.parts[Math.min(row + 1, this.lasts[row]!)]!;
  }

  /**
   * The row at which an action continues. recent: numbers of the last steps, the latest first. ends: whether it may end
   * where remembered motions do. done: the share of the movement that is over.
   */
  next(action: number, recent: Float32Array[], age: number, ends: boolean, uniform: number, done: number): number {
    const all = this.rows.get(action)!;
    if (!recent.length) {
      const least = all.reduce((found, row) => Math.min(found, this.ages[row]!), Infinity);
      const starts = all.filter((row) => this.ages[row] === least);
      return starts[Math.floor(uniform * starts.length)]!;
    }
    const fitting = all.filter(
      (row) => (age ? this.ages[row]! > 0 : this.parts[row]! < EARLY) && this.parts[row]! <= done + LEAP,
    );
    return this.near(fitting.length ? fitting : all, recent, age, ends, uniform);
  }

  /** The row at which an action is taken up to show the most of it in a number of steps. recent: as for `next`. */
  busiest(action: number, recent: Float32Array[], steps: number, uniform: number): number {
    const all = this.rows.get(action)!;
    const found: number[] = [];
    for (let at = 0; at < all.length; ) {
      const [start, last] = [all[at]!, this.lasts[all[at]!]!];
      const starts = Array.from({ length: Math.max(1, last + 1 - start - steps) }, (_, i) => start + i);
      const shown = starts.map((row) => this.acts[Math.min(row + steps, last)]! - this.acts[row]!);
      const most = shown.reduce((a, b) => Math.max(a, b));
      const good = starts.filter((_, at) => shown[at]! >= GOOD * most);
      found.push(good[Math.floor(good.length / 2)]!);
      while (at < all.length && all[at]! <= last) at++;
    }
    if (!recent.length) return found[Math.floor(uniform * found.length)]!;
    return this.near(found, recent, 0, false, uniform);
  }

  /** A row whose past resembles the present. */
  private near(rows: number[], recent: Float32Array[], age: number, ends: boolean, uniform: number): number {
    const off = new Float64Array(rows.length);
    for (let at = 0; at < rows.length; at++) {
      const later = LATER * (this.ages[rows[at]!]! - age) ** 2;
      off[at] = this.distance(rows[at]!, recent) + (ends ? later : Math.min(later, LATEST));
    }
    const least = off.reduce((a, b) => Math.min(a, b));
    let sum = 0;
    const shares = off.map((value) => (sum += Math.exp((least - value) / NEAR)));
    return rows[shares.findIndex((share) => share > uniform * sum)] ?? rows.at(-1)!;
  }

  private distance(row: number, recent: Float32Array[]): number {
    let sum = 0;
    for (let back = 0; back < PAST.length; back++) {
      const seen = recent[Math.min(back, recent.length - 1)]!;
      const start = (row - Math.min(this.ages[row]!, back + 1)) * this.width;
      let apart = 0;
      for (let at = 0; at < this.width; at++) {
        const off = this.numbers[start + at]! - seen[at]!;
        apart += off * off;
      }
      sum += PAST[back]! * apart;
    }
    return sum;
  }
}

/** The last step of the motion of each step, by the steps' ages. */
function lastsOf(ages: Int32Array): Int32Array {
  const lasts = new Int32Array(ages.length);
  for (let start = 0, stop = 0; start < ages.length; start = stop) {
    do stop++;
    while (stop < ages.length && ages[stop] === ages[stop - 1]! + 1);
    lasts.fill(stop - 1, start, stop);
  }
  return lasts;
}
