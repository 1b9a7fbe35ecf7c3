/* The acts that a figure knows by name: motet/steering/repertoire.py, whose file a page holds. */
import { ACTS, REPERTOIRE } from "../generated.js";
import { type Packed, unpacked } from "../bundle/packing.js";
import { BONES, SIDES } from "../figures/humanoid/bones.js";
import { type Act, actOf, type ActModel } from "./acts.js";
import { clamp } from "../motion/springs.js";
import type { WordTable } from "./spoken.js";

/** An act of the file: its name and what else is said for it; the rows that it has; with which hand or foot it is shown. */
interface GivenAct {
  name: string;
  also: string[];
  arms: boolean;
  first: number;
  frames: number;
  side?: string;
  limb?: string;
  mirror?: boolean;
}

/** The file: words, acts, and every other frame of all acts, each row the difference from the row before, its sign the lowest bit. */
export interface GivenActs extends Packed {
  words: WordTable;
  acts: GivenAct[];
  steps: number;
}

/** An act of the repertoire; of its phrases the first is its name. */
export interface Entry {
  name: string;
  phrases: string[];
  side: string;
  limbs: Set<string>;
  arms: boolean;
  first: number;
  frames: number;
  mirror: boolean;
}

/** The entry of an act of the file. */
export function entryOf({ name, also, arms, first, frames, side, limb, mirror }: GivenAct): Entry {
  return {
    name,
    phrases: [name, ...also],
    side: side ?? "",
    limbs: new Set((limb ?? "").split(" ").filter(Boolean)),
    arms,
    first,
    frames,
    mirror: mirror ?? false,
  };
}

/** Frames of an act, each of ACTS.WIDTH numbers. */
export type Frames = number[][];

export class Repertoire {
  readonly entries: Map<string, Entry>;
  private readonly made = new Map<string, Act>();

  private constructor(
    private readonly model: ActModel,
    file: GivenActs,
    private readonly rows: Float64Array,
  ) {
    this.entries = new Map(file.acts.map((act) => [act.name, entryOf(act)]));
  }

  static async of(file: GivenActs, model: ActModel): Promise<Repertoire> {
    const { frames } = await unpacked(file);
    // the sign is the lowest bit
    const rows = Float64Array.from(frames!, (code) => (code >> 1) ^ -(code & 1));
    for (let at = ACTS.WIDTH; at < rows.length; at++) rows[at]! += rows[at - ACTS.WIDTH]!;
    const numbers = rows.map((value) => value / file.steps);
    return new Repertoire(model, file, numbers);
  }

  /** An act; with a hand or foot, or to a side, "left" or "right"; so many times as fast; so often in a row. */
  act(name: string, side = "", tempo = 1, count = 1): Act {
    const key = [name, side, tempo, count].join("|");
    const known = this.made.get(key);
    if (known) return known;
    if (this.made.size >= REPERTOIRE.MADE_ACTS) this.made.delete(this.made.keys().next().value!);
    const act = actOf(this.model, name, this.performance(name, side, tempo, count).flat());
    this.made.set(key, act);
    return act;
  }

  /** The frames of `act`. */
  performance(name: string, side = "", tempo = 1, count = 1): Frames {
    const entry = this.entries.get(name)!;
    let numbers = this.numbersOf(entry);
    if (side && side !== entry.side) numbers = mirrored(numbers);
    if (tempo !== 1) numbers = atTempo(numbers, tempo);
    return joined(Array.from({ length: count }, () => numbers));
  }

  /** All frames of an act as it is shown: those between two kept ones lie on the cubic through four. */
  private numbersOf({ first, frames, mirror }: Entry): Frames {
    const kept = Array.from({ length: frames }, (_, at) =>
      Array.from(this.rows.subarray((first + at) * ACTS.WIDTH, (first + at + 1) * ACTS.WIDTH)),
    );
    const row = (at: number) => kept[clamp(at, 0, frames - 1)]!;
    const numbers = kept.flatMap((now, at) => {
      if (at + 1 === frames) return [now];
      const [before, next, after] = [row(at - 1), row(at + 1), row(at + 2)];
      const middle = now.map((value, i) => (9 * (value + next[i]!) - before[i]! - after[i]!) / 16);
      return [now, middle];
    });
    return mirror ? mirrored(numbers) : numbers;
  }
}

const OTHER_SIDE = BONES.map((bone) => {
  const [left, right] = SIDES;
  const other = bone.startsWith(left!)
    ? right! + bone.slice(left!.length)
    : bone.startsWith(right!)
      ? left! + bone.slice(right!.length)
      : bone;
  return BONES.indexOf(other);
});

/** Frames with left and right exchanged. */
function mirrored(numbers: Frames): Frames {
  return numbers.map((frame) => {
    const [x, z, facing, height] = frame.slice(-4) as [number, number, number, number];
    const quaternions = OTHER_SIDE.flatMap((bone) => {
      const [qx, qy, qz, qw] = frame.slice(4 * bone, 4 * bone + 4) as [number, number, number, number];
      return [qx, -qy, -qz, qw];
    });
    return [...quaternions, -x, z, -facing, height];
  });
}

/** Frames played faster or slower. */
function atTempo(numbers: Frames, tempo: number): Frames {
  const last = numbers.length - 1;
  const count = Math.trunc(last / tempo + 0.5) + 1;
  return Array.from({ length: count }, (_, at) => {
    const time = at * (last / (count - 1));
    const before = Math.min(Math.trunc(time), last - 1);
    const share = time - before;
    return numbers[before]!.map((value, i) => (1 - share) * value + share * numbers[before + 1]![i]!);
  });
}

/** Frames of performances in a row: each begins where the one before ends, over into it in some frames. */
function joined(parts: Frames[], seam: number = REPERTOIRE.SEAM): Frames {
  let whole = parts[0]!;
  for (const part of parts.slice(1)) {
    const length = Math.min(seam, whole.length >> 1, part.length >> 1);
    const start = whole.length - length;
    const following = placed(part, whole[start]!);
    const after = signedLike(whole[start]!, following.slice(0, length));
    const mixed = after.map((frame, at) => {
      const share = (at + 1) / (length + 1);
      return frame.map((value, i) => (1 - share) * whole[start + at]![i]! + share * value);
    });
    whole = [...whole.slice(0, start), ...mixed, ...signedLike(mixed.at(-1)!, following.slice(length))];
  }
  return whole;
}

/** Frames moved over the ground so that they begin where a frame is. */
function placed(numbers: Frames, start: number[]): Frames {
  const [startX, startZ, startFacing] = start.slice(-4) as [number, number, number];
  const [firstX, firstZ, firstFacing] = numbers[0]!.slice(-4) as [number, number, number];
  const turn = startFacing - firstFacing;
  const cos = Math.cos(turn);
  const sin = Math.sin(turn);
  return numbers.map((frame) => {
    const [toX, toZ, facing, height] = frame.slice(-4) as [number, number, number, number];
    const x = toX - firstX;
    const z = toZ - firstZ;
    const ground = [startX + cos * x + sin * z, startZ + cos * z - sin * x];
    return [...frame.slice(0, -4), ...ground, startFacing + (facing - firstFacing), height];
  });
}

/** Frames whose quaternions are on the same side as those of the frame before them. */
function signedLike(before: number[], numbers: Frames): Frames {
  const signs = BONES.map((_, bone) => {
    const same = [0, 1, 2, 3].reduce((sum, i) => sum + before[4 * bone + i]! * numbers[0]![4 * bone + i]!, 0);
    return same < 0 ? -1 : 1;
  });
  return numbers.map((frame) =>
    frame.map((value, i) => (i < 4 * BONES.length ? signs[i >> 2]! * value : value)),
  );
}
