/* Clips in place: found by their feet, and given the path that these imply: docs/reference/retargeting.md, "Clips in place". */
import { CONTACTS, treadmillSettings } from "../../generated.js";
import { MotionError } from "../../errors.js";
import { groundUnder, HUMANOID, isHumanoid, LEG_LENGTH, SIDES, solePoints } from "../humanoid/bones.js";
import { checked, type Motion, resampled, worldOf } from "../../motion/motion.js";
import { extents, rounded, sumOf } from "../../motion/numbers.js";
import { toHumanoid } from "../humanoid/retarget.js";
import { heightsByFeet, type Plane, velocityByFeet } from "./contacts.js";
import { inverse, mean, minus, plus, rotated, times, type Vector } from "../../motion/rotations.js";

const FEET = SIDES.flatMap((side) => ["Foot", "Toes", "Toes_end"].map((part) => HUMANOID.index(side + part)));

/** The motion or, if it is a clip in place, the motion with the path that its feet imply, of which the console is warned. */
export function travelling(motion: Motion): Motion {
  if (!isInPlace(motion)) return motion;
  console.warn("the feet stride while the root stays: models take it with the path that the feet imply");
  return withTravel(motion);
}

/** Whether the feet of a human figure stride while its root stays. */
export function isInPlace(motion: Motion): boolean {
  if (!motion.travels) return false;
  const looked = resampled(motion, Math.min(motion.fps, treadmillSettings.fps));
  const least = Math.max(3, treadmillSettings.least * looked.fps);
  if (looked.rotations.length < least || goes(looked)) return false;
  try {
    return strides(seen(looked).motion);
  } catch (error) {
    if (error instanceof MotionError) return false;
    throw error;
  }
}

/**
 * The motion of a human figure with the path over the ground that its feet imply added to its own; heights, turns and
 * sway stay. MotionError where it is no human's.
 */
export function withTravel(motion: Motion): Motion {
  const { motion: figure, toFile } = seen(motion);
  const root = figure.translations.map((moves) => moves[0]!);
  const path = pathOf(figure);
  const translations = motion.translations.map((moves, at) => {
    const laid: Vector = [
      path[at]![0] - root[at]![0] + root[0]![0],
      0,
      path[at]![1] - root[at]![2] + root[0]![2],
    ];
    return [plus(moves[0]!, toFile(laid)), ...moves.slice(1)];
  });
  return checked({ ...motion, translations, travels: true });
}

/** The motion on the humanoid, and what brings its paths to the file's world. */
function seen(motion: Motion): { motion: Motion; toFile: (path: Vector) => Vector } {
  if (isHumanoid(motion.skeleton)) return { motion, toFile: (path) => path };
  const { motion: humanoid, figure, turn } = toHumanoid(motion);
  return {
    motion: humanoid,
    toFile: (path) => times(rotated(inverse(turn), path), figure.fitted.leg / LEG_LENGTH),
  };
}

/** Whether, before the figure is measured, the first joint that moves goes too far: most recordings end here. */
function goes({ skeleton, translations }: Motion): boolean {
  for (const joint of skeleton.joints.keys()) {
    const [x, y, z] = extents(translations.map((moves) => moves[joint]!));
    if (x || y || z)
      return Math.hypot(x, z) > 1.5 * treadmillSettings.room * (skeleton.height / CONTACTS.ADULT_HEIGHT);
  }
  return false;
}

/** Whether the root of the humanoid stays while its feet, on which it stands, stride further than it goes. */
function strides(motion: Motion): boolean {
  const { fps } = motion;
  const root = motion.translations.map((moves) => moves[0]!);
  const [x, , z] = extents(root);
  if (Math.hypot(x, z) > treadmillSettings.room) return false;
  const soles = solePoints(worldOf(motion));

  // the feet are fast, and the root goes less far than they do
  const span = treadmillSettings.span * fps;
  const slid = averaged(slidOf(soles, fps), span);
  const went = averaged(
    root.slice(1).map((place, at) => flat([times(minus(place, root[at]!), fps)])[0]!),
    span,
  );
  const way = (velocity: Plane) => velocity.reduce((sum, step) => sum + Math.hypot(...step), 0);
  if (way(slid) < treadmillSettings.speed * slid.length) return false;
  if (way(went) > treadmillSettings.share * way(slid)) return false;

  // by turns one foot is ahead of the other, and the body stands
  const left = aheadOf(soles, 0, root, slid);
  const right = aheadOf(soles, 3, root, slid);
  const apart = left.map((place, at) => place - right[at]!);
  const hips = average(root.map((place) => place[1])) - average(soles.flat().map((point) => point[1]));
  return (
    Math.sqrt(together(apart, apart)) >= treadmillSettings.stride &&
    together(left, right) < 0 &&
    hips >= treadmillSettings.hips
  );
}

/** The velocity that would keep points of soles from sliding. */
function slidOf(soles: Vector[][], fps: number): Plane {
  const ground = groundUnder(soles);
  const heights = soles.map((row) => row.map((point) => point[1] - ground));
  return velocityByFeet(soles.map(flat), heights, fps);
}

/** How far a foot, of three points from the first on, is ahead of the root along a velocity, from the second frame on. */
function aheadOf(soles: Vector[][], first: number, root: Vector[], velocity: Plane): number[] {
  return velocity.map(([x, z], at) => {
    const foot = minus(mean(soles[at + 1]!.slice(first, first + 3)), root[at + 1]!);
    return (foot[0] * x + foot[2] * z) / Math.max(Math.hypot(x, z), 1e-9);
  });
}

/** The path over the ground of a motion of the humanoid whose feet do not slide, from the origin. */
function pathOf(motion: Motion): Plane {
  const { fps } = motion;
  const points = worldOf(motion).places.map((pose) => FEET.map((joint) => minus(pose[joint]!, pose[0]!)));
  const standing = points.map((row) => -Math.min(...row.map((point) => point[1])));
  const heights = heightsByFeet(standing, fps);
  const velocity = velocityByFeet(
    points.map(flat),
    points.map((row, at) => row.map((point) => point[1] + heights[at]![0]!)),
    fps,
  );
  const path: Plane = [[0, 0]];
  velocity.forEach(([x, z], at) => path.push([path[at]![0] + x / fps, path[at]![1] + z / fps]));
  return path;
}

function flat(points: Vector[]): Plane {
  return points.map(([x, , z]) => [x, z]);
}

/** Velocities, each the mean of so many frames around it, of fewer at the ends. */
function averaged(velocity: Plane, frames: number): Plane {
  const window = Math.max(1, Math.min(rounded(frames), velocity.length));
  const before = Math.floor(window / 2);
  return velocity.map((_, at) => {
    const near = velocity.slice(Math.max(0, at - before), at - before + window);
    return [average(near.map(([x]) => x)), average(near.map(([, z]) => z))];
  });
}

function average(values: number[]): number {
  return sumOf(values) / values.length;
}

/** The covariance of two rows. */
function together(first: number[], other: number[]): number {
  const a = average(first);
  const b = average(other);
  return average(first.map((value, at) => (value - a) * (other[at]! - b)));
}
