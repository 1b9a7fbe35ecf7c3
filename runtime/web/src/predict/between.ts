/* Filling gaps of placed frames: docs/reference/bundle.md, the loop `between`. Three numbers of place, then two axes a bone. */
import { PLACED } from "../generated.js";
import { batched } from "../bundle/arrays.js";
import type { Graph } from "../bundle/graph.js";
import { hermite } from "../motion/numbers.js";
import { quaternionOf, rotated, rotationOf, towards, type Vector, X, Y } from "../motion/rotations.js";

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
  const inputs = { past: batched(before!), plain: batched(plain), after: batched(behind!) };
  const { data, shape } = (await filler.run(inputs)).filled!;
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
      frame[i] = hermite(start[i]!, (frames + 1) * leaves[i]!, end[i]!, (frames + 1) * arrives[i]!, s);
    }
    for (let bone = PLACED.ROOT_PLACE; bone < start.length; bone += 6) {
      const [from, to] = [start, end].map((pose) => quaternionOf(rotationOf(pose, bone)));
      const turn = towards(from!, to!, s);
      frame.set(rotated(turn, X), bone);
      frame.set(rotated(turn, Y), bone + 3);
    }
    return frame;
  });
}

/** Metres a frame. */
function velocity(frames: Float64Array[]): number[] {
  const steps = Math.max(1, frames.length - 1);
  return [0, 1, 2].map((i) => (frames.at(-1)![i]! - frames[0]![i]!) / steps);
}
