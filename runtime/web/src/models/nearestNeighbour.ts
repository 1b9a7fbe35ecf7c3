/* What a motion shows, answered from known motions that are near it: docs/reference/bundle.md, "Describe". */
import { NEAREST_NEIGHBOUR, answerSettings } from "../generated.js";
import type { Bundle, Manifest } from "../bundle/bundle.js";
import { BundleError } from "../errors.js";
import type { Frames } from "./base.js";
import { sumOf } from "../motion/numbers.js";
import { clamp } from "../motion/springs.js";
import { type Settings, settingsOf } from "../settings.js";

/** What a sentence says that somebody goes backwards by. */
const BACKWARDS = /backward|in reverse|retreat/;

/** By how many degrees a path turns to the left, undefined where that is not told, and the mean speed forward in m/s. */
export interface Path {
  turn: number | undefined;
  ahead: number;
}

/** The tables, row after row. */
interface Tables {
  vectors: Int8Array;
  actions: Int16Array;
  shown: Uint8Array;
  sentences: string[];
  /** Of each sentence the action that it is said of. */
  actionOf: Int16Array;
  names: Uint8Array;
  ways: Int16Array;
}

/** Known motions and what is said of them. */
export class Known {
  readonly settings: Settings<typeof answerSettings>;
  /** The different sets of kinds that sentences name, and which of them each sentence names. */
  private readonly sets: number[][];
  private readonly named: number[];

  private constructor(
    private readonly tables: Tables,
    private readonly shape: number[],
    private readonly kinds: number,
    values?: Record<string, number>,
  ) {
    this.settings = settingsOf("answer", answerSettings, values);
    const rows = tables.sentences.map((_, row) =>
      tables.names.subarray(row * kinds, (row + 1) * kinds).join(),
    );
    const order = [...new Set(rows)].sort(); // as zeros and ones they sort like numbers
    this.sets = order.map((row) => row.split(",").flatMap((flag, kind) => (flag === "1" ? [kind] : [])));
    const places = new Map(order.map((row, place) => [row, place]));
    this.named = rows.map((row) => places.get(row)!);
  }

  /** Those of a bundle that has any. */
  static async of(bundle: Bundle): Promise<Known | undefined> {
    if (!bundle.manifest.graphs.space) return undefined;
    const [vectors, actions, shown, letters, actionOf, names, ways] = await Promise.all(
      ["vectors", "actions", "shown", "sentences", "said", "names", "ways"].map((name) =>
        bundle.table(`known_${name}`),
      ),
    );
    const sentences = new TextDecoder().decode(letters!.data as Uint8Array).split("\n");
    const [count, kinds] = shown!.shape as [number, number];
    for (const rows of [actions!, actionOf!]) {
      if (!rows.data.length || (rows.data as Int16Array).some((action) => action < 0 || action >= count)) {
        throw new BundleError(`tables of known motions have numbers that are none of ${count} actions`);
      }
    }
    const fits =
      [actionOf!, names!, ways!].every((table) => table.shape[0] === sentences.length) &&
      names!.shape[1] === kinds;
    if (!fits || vectors!.shape[0] !== actions!.shape[0] || !vectors!.data.length)
      throw new BundleError("tables of known motions do not fit each other");
    const tables = Object.entries({ vectors, actions, shown, actionOf, names, ways }).map(([name, table]) => [
      name,
      table!.data,
    ]);
    return new Known(
      { ...Object.fromEntries(tables), sentences } as Tables,
      vectors!.shape,
      kinds,
      bundle.manifest.settings.answer,
    );
  }

  /** Up to `count` sentences about a motion at a place of the space, of so many seconds, with such a path. */
  answers(
    vector: ArrayLike<number>,
    seconds: number,
    path: Path,
    count: number,
  ): { text: string; probability: number }[] {
    const { counted, similarity } = this.near(vector);
    if (seconds < this.settings.shortest || similarity < this.settings.outside)
      return [{ text: NEAREST_NEIGHBOUR.NOTHING, probability: 0 }];
    const shares = this.shares(counted).map((share, set) => ({ share, set }));
    const best = shares.filter(({ share }) => share > 0).sort((a, b) => b.share - a.share || a.set - b.set);
    return best.slice(0, count).map(({ share, set }) => {
      return { text: this.sentence(set, counted, path), probability: this.probability(share) };
    });
  }

  /** How much each action counts, 1 in all, by the motions near a place; and the greatest similarity. */
  private near(vector: ArrayLike<number>): { counted: number[]; similarity: number } {
    const [motions, views, size] = this.shape as [number, number, number];
    const { near, temperature } = this.settings;
    const alike = Array.from({ length: motions }, (_, motion) => {
      const products = Array.from({ length: views }, (_, view) => {
        const start = (motion * views + view) * size;
        return this.tables.vectors
          .subarray(start, start + size)
          .reduce((sum, value, i) => sum + (value / 127) * vector[i]!, 0);
      });
      return Math.max(...products);
    });
    const order = [...alike].sort((a, b) => b - a);
    const least = order[Math.min(near, motions) - 1]!;
    const weights = alike.map((similarity) =>
      similarity >= least ? Math.exp((similarity - order[0]!) / temperature) : 0,
    );
    const total = sumOf(weights);
    const counted = new Array<number>(this.tables.shown.length / this.kinds).fill(0);
    weights.forEach((weight, motion) => {
      counted[this.tables.actions[motion]!]! += weight / total;
    });
    return { counted, similarity: order[0]! };
  }

  /** Of each set of kinds the share of near motions that it is right about; 0 where none of them is said to show it. */
  private shares(counted: number[]): number[] {
    const sets = new Set(this.named.filter((_, row) => counted[this.tables.actionOf[row]!]! > 0));
    const near = [...counted.keys()].filter((action) => counted[action]! > 0);
    return this.sets.map((set, place) => {
      if (!sets.has(place)) return 0;
      return near.reduce((sum, action) => sum + (this.right(set, action) ? counted[action]! : 0), 0);
    });
  }

  /** Whether a set of kinds is right about an action: one is shown, and none is not to be said. */
  private right(set: number[], action: number): boolean {
    const shown = set.map((kind) => this.tables.shown[action * this.kinds + kind]!);
    return shown.includes(2) && !shown.includes(0);
  }

  private probability(share: number): number {
    const kept = clamp(share, 0.02, 0.98);
    return 1 / (1 + Math.exp(-(this.settings.bias + this.settings.share * Math.log(kept / (1 - kept)))));
  }

  /** The sentence that names a set of kinds: one whose way fits if there is any, and then the one that counts most. If it is about going, what it lacks of the way is added. */
  private sentence(set: number, counted: number[], { turn, ahead }: Path): string {
    const { actionOf, ways, sentences } = this.tables;
    const side =
      turn === undefined || Math.abs(turn) < this.settings.turned
        ? 0
        : turn > 0
          ? NEAREST_NEIGHBOUR.GOES_LEFT
          : NEAREST_NEIGHBOUR.GOES_RIGHT;
    const rows = this.named.flatMap((kinds, row) =>
      kinds === set && counted[actionOf[row]!]! > 0 ? [row] : [],
    );
    const [best] = rows
      .map((row) => ({ row, fit: this.fit(row, turn, side), counts: counted[actionOf[row]!]! }))
      .sort((a, b) => b.fit - a.fit || b.counts - a.counts || a.row - b.row);
    const text = sentences[best!.row]!;
    if (!ways[3 * best!.row + 2]) return text;
    const back = ahead <= -this.settings.backwards && !BACKWARDS.test(text) ? ", backwards" : "";
    const turning =
      side && ways[3 * best!.row] !== side
        ? `, turning ${side === NEAREST_NEIGHBOUR.GOES_LEFT ? "left" : "right"}`
        : "";
    return text + back + turning;
  }

  /** How well the way of a sentence fits a path that turns by so many degrees to a side. */
  private fit(row: number, turn: number | undefined, side: number): number {
    if (turn === undefined) return 0;
    const [way, degrees] = this.tables.ways.subarray(3 * row, 3 * row + 2);
    if (degrees! > 0 && Math.abs(degrees! - Math.abs(turn)) > 30) return -1;
    if (side) return way === side ? 1 : way === -side || way === NEAREST_NEIGHBOUR.GOES_STRAIGHT ? -1 : 0;
    // neither turned nor straight for certain: the other side alone is wrong
    if (Math.abs(turn) > this.settings.straight)
      return way === (turn > 0 ? NEAREST_NEIGHBOUR.GOES_RIGHT : NEAREST_NEIGHBOUR.GOES_LEFT) ? -1 : 0;
    return way === NEAREST_NEIGHBOUR.GOES_STRAIGHT
      ? 0.5
      : way === NEAREST_NEIGHBOUR.GOES_LEFT || way === NEAREST_NEIGHBOUR.GOES_RIGHT
        ? -1
        : 0;
  }
}

/** The path of a figure in frames; nothing is told where its channels are missing, or it does not stay upright. */
export function pathOf(frames: Frames, motion: Manifest["motion"]): Path {
  const columns = ["root.forward", "root.turn", "root.pitch", "root.roll"].map((name) =>
    motion.channels.indexOf(name),
  );
  const [forward, turn, pitch, roll] = columns as [number, number, number, number];
  if (Math.min(...columns) < 0) return { turn: undefined, ahead: 0 };
  const factor = motion.units[turn]!.startsWith("rad") ? 180 / Math.PI : 1;
  const leant =
    Math.max(...Array.from(frames, (frame) => Math.max(Math.abs(frame[pitch]!), Math.abs(frame[roll]!)))) *
    factor;
  if (leant >= 70) return { turn: undefined, ahead: 0 };
  const sum = (column: number): number => frames.slice(1).reduce((all, frame) => all + frame[column]!, 0);
  return {
    turn: (sum(turn) / motion.fps) * factor,
    ahead: frames.length > 1 ? sum(forward) / (frames.length - 1) : 0,
  };
}
