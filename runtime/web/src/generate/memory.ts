import { MEMORY, type memorySettings } from "../generated.js";
import type { NumberArray } from "../bundle/arrays.js";
import { BundleError } from "../errors.js";
import { least, most } from "../motion/numbers.js";
import type { Settings } from "../settings.js";

/** Of each row of an action its age, and the share of the action that is over before it. */
interface Course {
  ages: number[];
  over: number[];
}

/** Remembered steps of codes: docs/reference/bundle.md, the loop `codes`. */
export class Memory {
  readonly steps: number;
  readonly ages: Int32Array;
  private readonly parts: Float64Array;
  private readonly particular: Float64Array;
  private readonly acts: Float64Array;
  private readonly lasts: Int32Array;
  /** Numbers of the codes of all steps, and how many a step has. */
  private readonly numbers: Float32Array;
  private readonly width: number;
  private readonly rows = new Map<number, number[]>();
  private readonly shown = new Map<number, Course>();

  /** Of each remembered action the steps of its shortest motion. */
  readonly shortest = new Map<number, number>();

  /**
   * table: (M, P + 2) codes, action, age. moves: (E, 3). body: (V, L). actions: how many there are. lent: for actions
   * that may have no steps the one whose steps they get.
   */
  constructor(
    private readonly table: NumberArray,
    private readonly moves: NumberArray,
    private readonly body: NumberArray,
    actions: number,
    readonly settings: Settings<typeof memorySettings>,
    lent: Map<number, number> = new Map(),
  ) {
    const steps = table.shape[0]!;
    const columns = table.shape[1]!;
    this.steps = steps;
    this.width = moves.shape[1]! + (columns - 3) * body.shape[1]!;
    this.numbers = new Float32Array(steps * this.width);
    this.ages = Int32Array.from({ length: steps }, (_, row) => Number(table.data[(row + 1) * columns - 1]));
    for (let row = 0; row < steps; row++) this.remember(row, actions);
    this.lasts = lastsOf(this.ages);
    const kinds = this.rows.size;
    for (const [action, other] of lent) {
      const rows = this.rows.get(other);
      if (rows && !this.rows.has(action)) this.rows.set(action, rows);
    }
    for (const [action, rows] of this.rows) {
      this.shortest.set(action, least(rows.map((row) => this.ages[this.lasts[row]!]!)));
    }
    const changes = this.changes(moves.shape[1]!, moves.shape[0]!);
    this.parts = this.over(changes.map((change) => this.settings.rest_weight + change));
    const rare = this.rarity(body.shape[0]!, moves.shape[0]!, kinds);
    this.particular = changes.map(
      (change, row) => (this.settings.pose_weight + change) * Math.exp(rare[row]!),
    );
    this.acts = this.over(this.particular);
  }

  /** How much the numbers of the body change before each step, squared; none before a motion's first and its end. */
  private changes(ways: number, end: number): Float64Array {
    const changes = new Float64Array(this.steps);
    for (let row = 0; row < this.steps; row++) {
      for (let at = ways; at < this.width && this.ages[row]! > 0 && this.column(row, 0) !== end; at++) {
        changes[row]! +=
          (this.numbers[row * this.width + at]! - this.numbers[(row - 1) * this.width + at]!) ** 2;
      }
    }
    return changes;
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
  private rarity(values: number, end: number, kinds: number): Float64Array {
    const columns = this.table.shape[1]!;
    const sums = new Float64Array(this.steps);
    const real = [...sums.keys()].filter((row) => this.column(row, 0) !== end);
    for (let column = 1; column < columns - 2; column++) {
      const has = Array.from({ length: values }, () => new Set<number>());
      for (const row of real) has[this.column(row, column)]!.add(this.column(row, columns - 2));
      for (const row of real) sums[row]! += Math.log(kinds / has[this.column(row, column)]!.size);
    }
    const mean = real.reduce((sum, row) => sum + sums[row]!, 0) / real.length;
    const spread = Math.sqrt(real.reduce((sum, row) => sum + (sums[row]! - mean) ** 2, 0) / real.length);
    const rare = new Float64Array(this.steps).fill(-Infinity);
    for (const row of real) rare[row] = (sums[row]! - mean) / Math.max(spread, 1e-12);
    return rare;
  }

  private column(row: number, column: number): number {
    return Number(this.table.data[row * this.table.shape[1]! + column]);
  }

  private remember(row: number, actions: number): void {
    const [move, ...body] = this.codes(row);
    const action = this.column(row, this.table.shape[1]! - 2);
    const age = this.ages[row]!;
    const values = this.body.shape[0]!;
    const known = move! >= 0 && move! <= this.moves.shape[0]!;
    let fits = known && action >= 0 && action < actions && age >= 0 && age <= row;
    for (const code of body) fits &&= code >= 0 && code < values;
    if (!fits) throw new BundleError("table memory is out of range");
    const rows = this.rows.get(action);
    if (rows) rows.push(row);
    else this.rows.set(action, [row]);
    this.numbers.set(this.numbersOf([move!, ...body]), row * this.width);
  }

  /** The numbers by which steps are compared: those of a step's codes, zeros for an end. */
  numbersOf(codes: number[]): Float32Array {
    const numbers = new Float32Array(this.width);
    if (codes[0]! >= this.moves.shape[0]!) return numbers;
    let place = 0;
    codes.forEach((code, column) => {
      const { data, shape } = column ? this.body : this.moves;
      for (let i = 0; i < shape[1]!; i++) numbers[place++] = Number(data[code * shape[1]! + i]);
    });
    return numbers;
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

  /** Whether an act ends at a row, and the share of it that is over after it. whole: as for `next`. */
  after(action: number, row: number, whole: boolean): { end: boolean; done: number } {
    const { over } = this.course(action, whole);
    const at = this.rows.get(action)!.indexOf(row);
    return { end: over[at] === 1, done: over[row < this.lasts[row]! ? at + 1 : at]! };
  }

  /**
   * The row at which an action continues. recent: numbers of the last steps, the latest first. ends: whether it may end
   * where remembered motions do. done: the share of it that is over. whole: all of it is shown; else, of long
   * recordings, an act.
   */
  next(
    action: number,
    recent: Float32Array[],
    age: number,
    ends: boolean,
    uniform: number,
    done: number,
    whole: boolean,
  ): number {
    const all = this.rows.get(action)!;
    const { ages, over } = this.course(action, whole);
    if (!recent.length) {
      const youngest = least(ages);
      const starts = all.filter((_, at) => ages[at] === youngest);
      return starts[Math.floor(uniform * starts.length)]!;
    }
    const places = [...all.keys()];
    const fitting = places.filter(
      (at) =>
        (age ? ages[at]! > 0 : over[at]! < this.settings.entry) && over[at]! <= done + this.settings.skip,
    );
    const used = fitting.length ? fitting : places;
    const rows = used.map((at) => all[at]!);
    const rowAges = used.map((at) => ages[at]!);
    return this.near(rows, rowAges, recent, age, ends, uniform);
  }

  /** The ages of an action's rows and the shares that are over; unless all is shown those of its acts, which end at 1. */
  private course(action: number, whole: boolean): Course {
    const rows = this.rows.get(action)!;
    const course = { ages: rows.map((row) => this.ages[row]!), over: rows.map((row) => this.parts[row]!) };
    if (whole) return course;
    const known = this.shown.get(action);
    if (known) return known;
    for (const { take, pieces } of this.takes(rows)) {
      const [first, last] = this.act(take);
      if (last + 1 - first === take.length) continue;
      rows.forEach((row, at) => {
        if (!pieces.has(this.lasts[row]!)) return;
        const age = this.ages[row]! - this.ages[take[first]!]!;
        const inside = age >= 0 && age <= last - first;
        course.ages[at] = inside ? age : MEMORY.FORGOTTEN_AGE;
        course.over[at] = inside ? age / (last - first) : Infinity;
      });
    }
    this.shown.set(action, course);
    return course;
  }

  /** The rows of each recording, and the last rows of its pieces, each of which begins within the one before. */
  private takes(rows: number[]): { take: number[]; pieces: Set<number> }[] {
    const motions = [...new Set(rows.map((row) => this.lasts[row]!))].map((last) =>
      rows.filter((row) => this.lasts[row] === last),
    );
    const takes: { take: number[]; pieces: Set<number> }[] = [];
    for (const piece of motions.sort((a, b) => this.ages[a[0]!]! - this.ages[b[0]!]!)) {
      const codes = (some: number[]) => some.map((row) => this.codes(row)).join();
      const place = (take: number[]) => this.ages[piece[0]!]! - this.ages[take[0]!]!;
      const begin = codes(piece.slice(0, this.settings.past_steps));
      const before = takes.find(
        ({ take }) =>
          place(take) > 0 && codes(take.slice(place(take), place(take) + this.settings.past_steps)) === begin,
      );
      const last = this.lasts[piece[0]!]!;
      if (!before) takes.push({ take: piece, pieces: new Set([last]) });
      else {
        before.take = [...before.take, ...piece.slice(before.take.length - place(before.take))];
        before.pieces.add(last);
      }
    }
    return takes;
  }

  /** From which to which place the rows of a recording are an act: what shows most of it, is short, and begins and ends as it. */
  private act(take: number[]): [number, number] {
    const end = take.length - 1;
    if (end <= this.settings.act_steps) return [0, end];
    // distances of all steps of the recording, each with those before it
    const past = take.map((row) =>
      Array.from({ length: this.settings.past_steps }, (_, back) => this.past(row, back)),
    );
    const apart = take.map((row) => Float64Array.from(past, (seen) => this.distance(row, seen)));
    const enough = this.settings.act_share * take.reduce((sum, row) => sum + this.particular[row]!, 0);
    const edge = (to: number, at: number) => Math.min(apart[to]![at]! / this.settings.alike_distance, 1);
    const shown = take.map(() => end + 1); // where each step is first shown, from a place on
    // for each first step, from the last back, the earliest last step by which enough is shown
    const spans: [number, number, number][] = [];
    for (let first = end; first >= 0; first--) {
      take.forEach(
        (_, at) => (shown[at] = apart[first]![at]! <= this.settings.alike_distance ? first : shown[at]!),
      );
      const order = [...take.keys()].sort((a, b) => shown[a]! - shown[b]! || a - b);
      let sum = 0;
      let k = 0;
      while (k < end && (sum += this.particular[take[order[k]!]!]!) < enough) k++;
      for (let last = Math.max(shown[order[k]!]! + 1, first + this.settings.act_steps); last <= end; last++) {
        spans.push([
          last -
            first +
            this.settings.edge_cost * (edge(0, first) + Math.min(edge(0, last), edge(end, last))),
          first,
          last,
        ]);
      }
    }
    // the cheapest span; of several the first
    spans.sort((a, b) => a[0] - b[0] || a[1] - b[1] || a[2] - b[2]);
    const [, first, last] = spans[0] ?? [0, 0, end];
    return [first, last];
  }

  /** The row at which an action is taken up to show the most of it in a number of steps. recent: as for `next`. */
  busiest(action: number, recent: Float32Array[], steps: number, uniform: number): number {
    const all = this.rows.get(action)!;
    const entries: number[] = [];
    for (let at = 0; at < all.length;) {
      const start = all[at]!;
      const last = this.lasts[all[at]!]!;
      const starts = Array.from({ length: Math.max(1, last + 1 - start - steps) }, (_, i) => start + i);
      const shown = starts.map((row) => this.acts[Math.min(row + steps, last)]! - this.acts[row]!);
      const enough = this.settings.good_start * most(shown);
      const good = starts.filter((_, at) => shown[at]! >= enough);
      entries.push(good[Math.floor(good.length / 2)]!);
      while (at < all.length && all[at]! <= last) at++;
    }
    if (!recent.length) return entries[Math.floor(uniform * entries.length)]!;
    const ages = entries.map((row) => this.ages[row]!);
    return this.near(entries, ages, recent, 0, false, uniform);
  }

  /** A row whose past resembles the present. */
  private near(
    rows: number[],
    ages: number[],
    recent: Float32Array[],
    age: number,
    ends: boolean,
    uniform: number,
  ): number {
    const off = new Float64Array(rows.length);
    for (let at = 0; at < rows.length; at++) {
      const later = this.settings.age_cost * (ages[at]! - age) ** 2;
      off[at] =
        this.distance(rows[at]!, recent) + (ends ? later : Math.min(later, this.settings.age_cost_limit));
    }
    const nearest = least(off);
    let sum = 0;
    const shares = off.map((value) => (sum += Math.exp((nearest - value) / this.settings.distance_scale)));
    return rows[shares.findIndex((share) => share > uniform * sum)] ?? rows.at(-1)!;
  }

  /** The numbers of the step so many before a row and the one before it, of its own motion. */
  private past(row: number, back: number): Float32Array {
    const start = (row - Math.min(this.ages[row]!, back + 1)) * this.width;
    return this.numbers.subarray(start, start + this.width);
  }

  private distance(row: number, recent: Float32Array[]): number {
    let sum = 0;
    for (let back = 0; back < this.settings.past_steps; back++) {
      const seen = recent[Math.min(back, recent.length - 1)]!;
      const remembered = this.past(row, back);
      let apart = 0;
      for (let at = 0; at < this.width; at++) {
        const off = remembered[at]! - seen[at]!;
        apart += off * off;
      }
      sum += this.settings.past_fading ** back * apart;
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
