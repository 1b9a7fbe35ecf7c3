/* Filling gaps of placed frames: docs/reference/bundle.md, the loop `between`. Three numbers of place, then two axes a bone. */
import { PLACED } from "../generated.js";
import { stacked } from "../bundle/arrays.js";
import type { Graph } from "../bundle/graph.js";
import { cross, dot, type Rotation, rotationOf, unit, type Vector } from "../motion/rotations.js";

/** Steps over which the velocities next to a gap are taken. */
const STEPS = 3;

/** What fills a gap of so many frames (frames, E) between frames before it (P, E) and after it (A, E). */
export async function between(
  filler: Graph,
  past: ArrayLike<number>[],
  after: ArrayLike<number>[],
  frames: number,
) {
  const pose = poseOf(past.at(-1)!);
  const [before, behind] = [past, after].map((part) => part.map((frame) => seenFrom(frame, pose)));
  const plain = bridge(before!, behind!, frames);
  const batch = (part: ArrayLike<number>[]) => stacked(part, 1, part.length, part[0]!.length);
  const { data, shape } = (
    await filler.run({ past: batch(before!), plain: batch(plain), after: batch(behind!) })
  ).filled!;
  const width = shape[2]!;
  return Array.from({ length: frames }, (_, at) => putAt(data.subarray(at * width, (at + 1) * width), pose));
}

/** Where a figure is and how it faces: x, z, radians. */
function poseOf(frame: ArrayLike<number>): Vector {
  const [x, , z] = rotationOf(frame, PLACED.ROOT_PLACE);
  return [frame[0]!, frame[2]!, Math.atan2(z[0] - x[2], x[0] + z[2])];
}

function seenFrom(frame: ArrayLike<number>, [x, z, facing]: Vector): Float64Array {
  const moved = Float64Array.from(frame);
  moved[0]! -= x;
  moved[2]! -= z;
  return turned(moved, -facing);
}

function putAt(frame: ArrayLike<number>, [x, z, facing]: Vector): Float64Array {
  const moved = turned(Float64Array.from(frame), facing);
  moved[0]! += x;
  moved[2]! += z;
  return moved;
}

/** Place and axes of the hips turned about the vertical axis. */
function turned(frame: Float64Array, angle: number): Float64Array {
  const sin = Math.sin(angle);
  const cos = Math.cos(angle);
  for (const at of [0, PLACED.ROOT_PLACE, PLACED.ROOT_PLACE + 3]) {
    const x = frame[at]!;
    const z = frame[at + 2]!;
    frame[at] = x * cos + z * sin;
    frame[at + 2] = z * cos - x * sin;
  }
  return frame;
}

/** A plain way through a gap: joints turn at an even speed, the hips go on a cubic Hermite curve. */
function bridge(past: Float64Array[], after: Float64Array[], frames: number): Float64Array[] {
  const start = past.at(-1)!;
  const end = after[0]!;
  const leaves = velocity(past.slice(-STEPS - 1));
  const arrives = velocity(after.slice(0, STEPS + 1));
  return Array.from({ length: frames }, (_, at) => {
    const s = (at + 1) / (frames + 1);
    const frame = new Float64Array(start.length);
    for (let i = 0; i < PLACED.ROOT_PLACE; i++) {
      frame[i] =
        (1 + 2 * s) * (1 - s) ** 2 * start[i]! +
        s * (1 - s) ** 2 * (frames + 1) * leaves[i]! +
        s ** 2 * (3 - 2 * s) * end[i]! -
        s ** 2 * (1 - s) * (frames + 1) * arrives[i]!;
    }
    for (let bone = PLACED.ROOT_PLACE; bone < start.length; bone += 6) {
      const [x, y] = partOfTheWay(rotationOf(start, bone), rotationOf(end, bone), s);
      frame.set(x, bone);
      frame.set(y, bone + 3);
    }
    return frame;
  });
}

/** Metres a frame. */
function velocity(frames: Float64Array[]): number[] {
  const steps = Math.max(1, frames.length - 1);
  return [0, 1, 2].map((i) => (frames.at(-1)![i]! - frames[0]![i]!) / steps);
}

/** The rotation from which a share of the shortest turn to another is done. */
function partOfTheWay(from: Rotation, to: Rotation, share: number): Rotation {
  // the turn in the frame of `from`: element [i][j] is the j-th component of the i-th column
  const turn = to.map((column) => from.map((axis) => dot(axis, column))) as Rotation;
  const axis: Vector = [turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]];
  const sine = Math.hypot(...axis) / 2;
  const angle = Math.atan2(sine, (turn[0][0] + turn[1][1] + turn[2][2] - 1) / 2);
  const about: Vector = sine > 1e-9 ? unit(axis) : [1, 0, 0];
  const done = [0, 1, 2].map((i) =>
    rotated([+(i === 0), +(i === 1), +(i === 2)], about, share * angle),
  ) as Rotation;
  return done.map((column) =>
    [0, 1, 2].map((i) => from[0][i]! * column[0] + from[1][i]! * column[1] + from[2][i]! * column[2]),
  ) as Rotation;
}

/** A vector turned about a unit axis (Rodrigues). */
function rotated(vector: Vector, axis: Vector, angle: number): Vector {
  const sin = Math.sin(angle);
  const cos = Math.cos(angle);
  const aside = cross(axis, vector);
  const along = dot(axis, vector) * (1 - cos);
  return [0, 1, 2].map((i) => vector[i]! * cos + aside[i]! * sin + axis[i]! * along) as Vector;
}
