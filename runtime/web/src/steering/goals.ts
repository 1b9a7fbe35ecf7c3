/* The rows that a gait may jump to, searched for the nearest one: an exact search that passes over boxes of rows. */
import { MATCHING } from "../generated.js";

/** A cost of 1: costs are in units of 1 / (2 STEPS^2). */
export const UNIT = 2 * MATCHING.STEPS ** 2;
/** Consecutive goals that share a box, and a larger one: they follow each other in a recording, so they are alike. */
const SIZES = [8, 32] as const;
/** The two features of where a row leads at the last of the horizons. */
const LEFT = 4;
const FORWARD = 5;

/** Of each box of rows the least and the largest of each feature. */
interface Boxes {
  low: Int16Array;
  high: Int16Array;
}

/** Features of rows, and boxes of them. */
export class Goals {
  private readonly features: Int16Array;
  private readonly small: Boxes;
  private readonly large: Boxes;

  /** width: an even number of features. */
  constructor(
    features: Int16Array,
    private readonly width: number,
    readonly rows: number[],
    private readonly mean: Float32Array,
    private readonly scale: Float32Array,
    private readonly lag: number,
  ) {
    this.features = new Int16Array(rows.length * width);
    rows.forEach((row, at) =>
      this.features.set(features.subarray(row * width, (row + 1) * width), at * width),
    );
    this.small = this.boxes(SIZES[0]);
    this.large = this.boxes(SIZES[1]);
  }

  private boxes(size: number): Boxes {
    const count = Math.ceil(this.rows.length / size) * this.width;
    const low = new Int16Array(count).fill(32767);
    const high = new Int16Array(count).fill(-32768);
    this.features.forEach((value, at) => {
      const place = Math.floor(at / this.width / size) * this.width + (at % this.width);
      low[place] = Math.min(low[place]!, value);
      high[place] = Math.max(high[place]!, value);
    });
    return { low, high };
  }

  /** What the features at a place of an array cost: half the squared distance to those asked, and the lag. */
  cost(query: Int16Array, features: Int16Array, at: number): number {
    const way = this.way(query);
    let cost = Math.max(0, way[2] - way[0] * features[at + LEFT]! - way[1] * features[at + FORWARD]!);
    for (let i = 0; i < this.width; i++) cost += (features[at + i]! - query[i]!) ** 2;
    return cost;
  }

  /** The row that costs the least, less than `bound`, as it is or as its mirror image; none if there is none. */
  nearest(
    query: Int16Array,
    image: Int16Array,
    bound: number,
  ): { row: number; mirror: boolean; cost: number } | null {
    const straight = this.least(query, bound);
    const other = this.least(image, straight.cost);
    const at = other.at < 0 ? straight.at : other.at;
    return at < 0 ? null : { row: this.rows[at]!, mirror: other.at >= 0, cost: other.cost };
  }

  /** By how much it costs to lead less than half as far: of the steps left and forward, and of being there. */
  private way(query: Int16Array): [left: number, forward: number, half: number] {
    const { mean, scale, lag } = this;
    const left = query[LEFT]! / MATCHING.STEPS / scale[LEFT]! + mean[LEFT]!;
    const forward = query[FORWARD]! / MATCHING.STEPS / scale[FORWARD]! + mean[FORWARD]!;
    const far = Math.hypot(left, forward);
    const x = (lag * left) / Math.max(far, 1e-6);
    const z = (lag * forward) / Math.max(far, 1e-6);
    const half = (lag * far) / 2 - x * mean[LEFT]! - z * mean[FORWARD]!;
    return [
      2 * Math.round((MATCHING.STEPS * x) / scale[LEFT]!),
      2 * Math.round((MATCHING.STEPS * z) / scale[FORWARD]!),
      2 * MATCHING.STEPS * Math.round(MATCHING.STEPS * half),
    ];
  }

  private least(query: Int16Array, bound: number): { at: number; cost: number } {
    const { width, features, small, large, rows } = this;
    const [left, forward, half] = this.way(query);
    let best = -1;
    let cost = bound;
    for (let first = 0, outer = 0; first < rows.length; first += SIZES[1], outer += width) {
      if (outside(query, large, outer, width, left, forward, half, cost) >= cost) continue;
      const last = Math.min(first + SIZES[1], rows.length);
      for (
        let from = first, inner = (first / SIZES[0]) * width;
        from < last;
        from += SIZES[0], inner += width
      ) {
        if (outside(query, small, inner, width, left, forward, half, cost) >= cost) continue;
        const end = Math.min(from + SIZES[0], last);
        for (let at = from, place = from * width; at < end; at++, place += width) {
          const lag = half - left * features[place + LEFT]! - forward * features[place + FORWARD]!;
          let total = lag > 0 ? lag : 0;
          for (let i = 0; i < width && total < cost; i += 2) {
            const off = features[place + i]! - query[i]!;
            const next = features[place + i + 1]! - query[i + 1]!;
            total += off * off + next * next;
          }
          if (total < cost) {
            best = at;
            cost = total;
          }
        }
      }
    }
    return { at: best, cost };
  }
}

/** What the rows of a box cost at least, or a part of that which is as much as `cost`. */
function outside(
  query: Int16Array,
  { low, high }: Boxes,
  at: number,
  width: number,
  left: number,
  forward: number,
  half: number,
  cost: number,
): number {
  const lag =
    half - left * (left > 0 ? high : low)[at + LEFT]! - forward * (forward > 0 ? high : low)[at + FORWARD]!;
  let least = lag > 0 ? lag : 0;
  for (let i = 0; i < width && least < cost; i += 2) {
    const under = low[at + i]! - query[i]!;
    const over = query[i]! - high[at + i]!;
    const below = low[at + i + 1]! - query[i + 1]!;
    const above = query[i + 1]! - high[at + i + 1]!;
    const off = under > 0 ? under : over > 0 ? over : 0;
    const next = below > 0 ? below : above > 0 ? above : 0;
    least += off * off + next * next;
  }
  return least;
}
