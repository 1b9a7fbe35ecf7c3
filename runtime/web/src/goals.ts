/* The rows that a gait may jump to, searched for the nearest one: an exact search that passes over boxes of rows. */

/** Consecutive goals that share a box: they follow each other in a recording, so they are alike. */
const BOX = 8;
/** The two features of where a row leads at the last of the horizons. */
const [LEFT, FORWARD] = [4, 5];

/** What is asked is rounded, so that costs are exact sums: each runtime finds the same row. */
export function rounded(value: number): number {
  return Math.round(256 * value) / 256;
}

/** Features of rows, and for each box of them the least and the largest of each. */
export class Goals {
  private readonly features: Float32Array;
  private readonly low: Float32Array;
  private readonly high: Float32Array;

  constructor(
    features: Float32Array,
    private readonly width: number,
    readonly rows: number[],
    private readonly mean: Float32Array,
    private readonly scale: Float32Array,
    private readonly lag: number,
  ) {
    this.features = new Float32Array(rows.length * width);
    rows.forEach((row, at) => this.features.set(features.subarray(row * width, (row + 1) * width), at * width));
    const boxes = Math.ceil(rows.length / BOX);
    this.low = new Float32Array(boxes * width).fill(Infinity);
    this.high = new Float32Array(boxes * width).fill(-Infinity);
    this.features.forEach((value, at) => {
      const place = Math.floor(at / width / BOX) * width + (at % width);
      this.low[place] = Math.min(this.low[place]!, value);
      this.high[place] = Math.max(this.high[place]!, value);
    });
  }

  /** What the features at a place of an array cost: half the squared distance to those asked, and the lag. */
  cost(asked: Float64Array, features: Float32Array, at: number): number {
    const way = this.way(asked);
    const lag = way[2] - way[0] * features[at + LEFT]! - way[1] * features[at + FORWARD]!;
    let cost = lag > 0 ? lag : 0;
    for (let i = 0; i < this.width; i++) cost += (features[at + i]! - asked[i]!) ** 2 / 2;
    return cost;
  }

  /** The row that costs the least, less than `bound`, as it is or as its mirror image; none if there is none. */
  nearest(asked: Float64Array, image: Float64Array, bound: number): { row: number; mirror: boolean; cost: number } | null {
    const own = this.least(asked, bound);
    const other = this.least(image, own.cost);
    const at = other.at < 0 ? own.at : other.at;
    return at < 0 ? null : { row: this.rows[at]!, mirror: other.at >= 0, cost: other.cost };
  }

  /** By how much it costs to lead less than half as far: of the scaled left and forward, and of being there. */
  private way(asked: Float64Array): [left: number, forward: number, half: number] {
    const { mean, scale, lag } = this;
    const [left, forward] = [asked[LEFT]! / scale[LEFT]! + mean[LEFT]!, asked[FORWARD]! / scale[FORWARD]! + mean[FORWARD]!];
    const far = Math.hypot(left, forward);
    const [x, z] = [(lag * left) / Math.max(far, 1e-6), (lag * forward) / Math.max(far, 1e-6)];
    const half = (lag * far) / 2 - x * mean[LEFT]! - z * mean[FORWARD]!;
    return [rounded(x / scale[LEFT]!), rounded(z / scale[FORWARD]!), rounded(half)];
  }

  private least(asked: Float64Array, bound: number): { at: number; cost: number } {
    const { width, low, high, features, rows } = this;
    const [left, forward, half] = this.way(asked);
    let [best, cost] = [-1, bound];
    for (let box = 0, from = 0; from < rows.length; box += width, from += BOX) {
      const nearer = left * (left > 0 ? high : low)[box + LEFT]! + forward * (forward > 0 ? high : low)[box + FORWARD]!;
      let least = Math.max(half - nearer, 0);
      for (let i = 0; i < width && least < cost; i++) {
        const off = Math.max(low[box + i]! - asked[i]!, asked[i]! - high[box + i]!, 0);
        least += (off * off) / 2;
      }
      if (least * (1 - 1e-12) >= cost) continue; // a little is left for rounding
      for (let at = from; at < Math.min(from + BOX, rows.length); at++) {
        const lag = half - left * features[at * width + LEFT]! - forward * features[at * width + FORWARD]!;
        let own = lag > 0 ? lag : 0;
        for (let i = 0, place = at * width; i < width && own < cost; i++, place++) {
          const off = features[place]! - asked[i]!;
          own += (off * off) / 2;
        }
        if (own < cost) [best, cost] = [at, own];
      }
    }
    return { at: best, cost };
  }
}
