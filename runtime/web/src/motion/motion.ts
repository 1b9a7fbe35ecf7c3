import { MotionError } from "../errors.js";
import { eulersOf, fromEuler } from "./euler.js";
import { inverse, plus, product, type Quaternion, rotated, type Vector } from "./rotations.js";
import type { Skeleton } from "./skeleton.js";

/** Frames of a skeleton: of each joint its rotation and its translation in its parent's frame, in the skeleton's unit. */
export interface Motion {
  skeleton: Skeleton;
  /** Frames a second. */
  fps: number;
  /** By frame and joint. */
  rotations: Quaternion[][];
  translations: Vector[][];
  /** Whether the file says where the figure goes. */
  travels: boolean;
}

/** Rotations and positions of joints in the world, by frame and joint. */
export interface World {
  turns: Quaternion[][];
  places: Vector[][];
}

/** Numbers of a motion's frames, at most. */
const MAX_VALUES = 2 ** 26;

/** MotionError unless there is a frame, and all numbers of all frames are finite. */
export function checked(motion: Motion): Motion {
  const { fps, rotations, translations, skeleton } = motion;
  if (!(fps > 0 && fps < Infinity))
    throw new MotionError(`the frame rate must be a positive number, not ${fps}`);
  if (!rotations.length) throw new MotionError("this motion has no frames");
  const bad = rotations.findIndex(
    (turns, at) => ![...turns, ...translations[at]!].every((value) => value.every(Number.isFinite)),
  );
  if (bad >= 0) throw new MotionError(`frame ${bad} holds a number that is not finite`);
  if (rotations.length * skeleton.joints.length * 3 > MAX_VALUES)
    throw new MotionError(`${rotations.length} frames are too many`);
  return motion;
}

/** A skeleton in its rest pose, as one frame. */
export function atRest(skeleton: Skeleton): Motion {
  const rotations = [skeleton.joints.map((): Quaternion => [0, 0, 0, 1])];
  return {
    skeleton,
    fps: 1,
    rotations,
    translations: [skeleton.joints.map((joint) => joint.offset)],
    travels: false,
  };
}

/** Forward kinematics. */
export function worldOf(motion: Pick<Motion, "skeleton" | "rotations" | "translations">): World {
  const { skeleton, rotations, translations } = motion;
  const turns: Quaternion[][] = [];
  const places: Vector[][] = [];
  rotations.forEach((local, frame) => {
    const turned: Quaternion[] = [];
    const placed: Vector[] = [];
    skeleton.joints.forEach(({ parent }, at) => {
      const move = translations[frame]![at]!;
      turned.push(parent < 0 ? local[at]! : product(turned[parent]!, local[at]!));
      placed.push(parent < 0 ? move : plus(placed[parent]!, rotated(turned[parent]!, move)));
    });
    turns.push(turned);
    places.push(placed);
  });
  return { turns, places };
}

/** Positions of joints with the root at the origin, of rotations in the world. */
export function placesOf(skeleton: Skeleton, turned: Quaternion[]): Vector[] {
  const places: Vector[] = [];
  for (const { parent, offset } of skeleton.joints) {
    places.push(parent < 0 ? [0, 0, 0] : plus(places[parent]!, rotated(turned[parent]!, offset)));
  }
  return places;
}

/** The motion of rotations in the world and of translations of some joints in their parents' frames. */
export function motionFrom(
  skeleton: Skeleton,
  turns: Quaternion[][],
  moved: Map<number, Vector[]>,
  fps: number,
): Motion {
  const rotations = turns.map((turned) =>
    skeleton.joints.map(({ parent }, at) =>
      parent < 0 ? turned[at]! : product(inverse(turned[parent]!), turned[at]!),
    ),
  );
  const translations = turns.map((_, frame) =>
    skeleton.joints.map(({ offset }, at) => moved.get(at)?.[frame] ?? offset),
  );
  return checked({ skeleton, fps, rotations, translations, travels: true });
}

/** Some of a motion's frames. */
export function cut(motion: Motion, start: number, stop: number): Motion {
  return {
    ...motion,
    rotations: motion.rotations.slice(start, stop),
    translations: motion.translations.slice(start, stop),
  };
}

/**
 * The motion at another frame rate, from its first frame to none after its last, or with its last frame kept (toEnd):
 * frames are picked where the rates' ratio is whole, else Euler angles in the joints' orders and translations are on
 * lines between frames, or, for a higher rate, on Catmull-Rom splines.
 */
export function resampled(motion: Motion, fps: number, toEnd = false): Motion {
  const ratio = motion.fps / fps;
  const frames = motion.rotations.length;
  const count = Math.floor((frames - 1) / ratio + 1e-9) + 1;
  const { joints } = motion.skeleton;
  if (!(count * joints.length * 3 < MAX_VALUES))
    throw new MotionError(`${frames} frames at ${fps} fps are too many`);
  if (Math.abs(ratio - Math.round(ratio)) < 1e-9 && ratio > 0.5) {
    const start = toEnd ? (frames - 1) % Math.round(ratio) : 0;
    const picked = <T>(rows: T[]) => rows.filter((_, at) => (at - start) % Math.round(ratio) === 0);
    return { ...motion, fps, rotations: picked(motion.rotations), translations: picked(motion.translations) };
  }
  const times = Array.from({ length: count }, (_, at) =>
    toEnd ? frames - 1 - (count - 1 - at) * ratio : at * ratio,
  );
  const between = ratio < 1 ? onSplines : onLines;
  const turned = joints.map(({ order }, at) => {
    const turns = motion.rotations.map((row) => row[at]!);
    return between(eulersOf(turns, order), times).map((angles) => fromEuler(angles, order));
  });
  const moved = joints.map((_, at) => {
    const moves = motion.translations.map((row) => row[at]!);
    return between(moves, times);
  });
  const byFrame = <T>(byJoint: T[][]) => times.map((_, frame) => byJoint.map((rows) => rows[frame]!));
  return { ...motion, fps, rotations: byFrame(turned), translations: byFrame(moved) };
}

/** The frame before a time, and how far it is to the next. */
function place(values: Vector[], time: number): [number, number] {
  const start = Math.min(Math.floor(time + 1e-9), values.length - 2);
  return [start, time - start];
}

function onLines(values: Vector[], times: number[]): Vector[] {
  if (values.length < 2) return times.map(() => values[0]!);
  return times.map((time) => {
    const [start, part] = place(values, time);
    return values[start]!.map((value, axis) => value + part * (values[start + 1]![axis]! - value)) as Vector;
  });
}

/** Before the first and after the last frame the parabola through the nearest three goes on, or the line through two. */
function onSplines(values: Vector[], times: number[]): Vector[] {
  if (values.length < 2) return times.map(() => values[0]!);
  const beyond = ([a, b, c]: Vector[]) =>
    a!.map((value, axis) => (c ? 3 * value - 3 * b![axis]! + c[axis]! : 2 * value - b![axis]!)) as Vector;
  const padded = [beyond(values.slice(0, 3)), ...values, beyond(values.slice(-3).reverse())];
  return times.map((time) => {
    const [start, s] = place(values, time);
    return [0, 1, 2].map((axis) => {
      const value = (step: number) => padded[start + step]![axis]!;
      const [a, b, c, d] = [value(0), value(1), value(2), value(3)];
      return b + 0.5 * s * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)));
    }) as Vector;
  });
}
