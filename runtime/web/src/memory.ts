import type { NumberArray } from "./arrays.js";
import { BundleError } from "./errors.js";

/** Weights of the last step and those before it. */
const PAST = [1, 0.5, 0.25];
/** Places are drawn by exp(-distance / NEAR). */
const NEAR = 0.5;
/** What is added to a distance for each squared step of difference in age, and the most of it. */
const LATER = 1 / 64;
const LATEST = 2;
/** The part of a motion in which an action is taken up that follows another. */
const EARLY = 0.3;

/** Remembered steps of codes: docs/bundle.md, the loop `codes`. */
export class Memory {
  readonly steps: number;
  private readonly numbers: Float32Array[] = [];
  private readonly ages: number[] = [];
  private readonly parts: number[] = [];
  private readonly rows = new Map<number, number[]>();
  private readonly table: number[][];

  /** memory: (M, P + 2) codes, action, age. moves: (E, 3). body: (V, L). actions: how many there are. */
  constructor(memory: NumberArray, moves: NumberArray, body: NumberArray, actions: number) {
    const width = memory.shape[1]!;
    this.steps = memory.shape[0]!;
    this.table = Array.from({ length: this.steps }, (_, row) => Array.from(memory.data.subarray(row * width, (row + 1) * width), Number));
    const [end, values] = [moves.shape[0]!, body.shape[0]!];
    const take = (table: NumberArray, row: number) =>
      Array.from(table.data.subarray(row * table.shape[1]!, (row + 1) * table.shape[1]!), Number);
    this.table.forEach((step, row) => {
      const [move, action, age] = [step[0]!, step.at(-2)!, step.at(-1)!];
      const fits = move >= 0 && move <= end && step.slice(1, -2).every((code) => code >= 0 && code < values);
      if (!fits || action < 0 || action >= actions || age < 0 || age > row) throw new BundleError("table memory is out of range");
      const all = [...take(moves, Math.min(move, end - 1)), ...step.slice(1, -2).flatMap((code) => take(body, code))];
      this.numbers.push(Float32Array.from(all, (number) => (move < end ? number : 0)));
      this.ages.push(age);
      const rows = this.rows.get(action);
      if (rows) rows.push(row);
      else this.rows.set(action, [row]);
    });
    for (let start = 0; start < this.steps; ) {
      let stop = start + 1;
      while (stop < this.steps && this.ages[stop] === this.ages[stop - 1]! + 1) stop++;
      for (let row = start; row < stop; row++) this.parts.push((this.ages[row]! - this.ages[start]!) / (stop - start));
      start = stop;
    }
  }

  /** Whether anything of an action is remembered. */
  knows(action: number): boolean {
    return this.rows.has(action);
  }

  /** The codes (P) of a step. */
  codes(row: number): number[] {
    return this.table[row]!.slice(0, -2);
  }

  /**
   * The row at which an action continues. recent: numbers of the last steps, the latest first. ends: whether it may end
   * where remembered motions do.
   */
  next(action: number, recent: Float32Array[], age: number, ends: boolean, uniform: number): number {
    let rows = this.rows.get(action)!;
    if (!recent.length) {
      const least = Math.min(...rows.map((row) => this.ages[row]!));
      const starts = rows.filter((row) => this.ages[row] === least);
      return starts[Math.floor(uniform * starts.length)]!;
    }
    const fitting = rows.filter((row) => (age ? this.ages[row]! > 0 : this.parts[row]! < EARLY));
    if (fitting.length) rows = fitting;
    const off = rows.map((row) => {
      const later = LATER * (this.ages[row]! - age) ** 2;
      return this.distance(row, recent) + (ends ? later : Math.min(later, LATEST));
    });
    const least = off.reduce((a, b) => Math.min(a, b));
    let sum = 0;
    const shares = off.map((value) => (sum += Math.exp((least - value) / NEAR)));
    return rows[shares.findIndex((share) => share > uniform * sum)] ?? rows.at(-1)!;
  }

  private distance(row: number, recent: Float32Array[]): number {
    let sum = 0;
    PAST.forEach((weight, back) => {
      const seen = recent[Math.min(back, recent.length - 1)]!;
      const kept = this.numbers[row - Math.min(this.ages[row]!, back + 1)]!;
      for (let at = 0; at < kept.length; at++) sum += weight * (kept[at]! - seen[at]!) ** 2;
    });
    return sum;
  }
}
