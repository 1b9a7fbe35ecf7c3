/* Holding the feet of a whole motion: docs/reference/retargeting.md, "Planting of feet". */
import { CONTACTS, holdSettings } from "../../generated.js";
import { contacts } from "./contacts.js";
import { groundUnder, HUMANOID, isHumanoid, LEG, SIDES, solePoints } from "../humanoid/bones.js";
import { TwoBones } from "../twoBones.js";
import { type Motion, motionFrom, worldOf } from "../../motion/motion.js";
import { median, rise, rounded, smoothed, sumOf, windows } from "../../motion/numbers.js";
import { MotionError } from "../../errors.js";
import { product, rotated, type Vector, X } from "../../motion/rotations.js";

/** The motion of the humanoid with standing feet held in place and never below ground, by turning hips, knees and ankles. */
export function holdFeet(motion: Motion): Motion {
  if (!isHumanoid(motion.skeleton))
    throw new MotionError("feet are held of the humanoid: convert the motion with toHumanoid first");
  if (motion.rotations.length < 2) return motion;
  const world = worldOf(motion);
  const soles = solePoints(world);
  const ground = groundUnder(soles);
  const turned = world.turns.map((turns) => [...turns]);
  SIDES.forEach((side, at) => {
    const joints = LEG.slice(0, 3).map((part) => HUMANOID.index(side + part));
    const points = soles.map((frame) =>
      frame.slice(3 * at, 3 * at + 3).map(([x, y, z]): Vector => [x, y - ground, z]),
    );
    const [hip, knee, ankle] = joints.map((joint) => world.places.map((pose) => pose[joint]!)) as [
      Vector[],
      Vector[],
      Vector[],
    ];
    const legs = hip.map(
      (place, frame) =>
        new TwoBones(place, knee[frame]!, ankle[frame]!, rotated(world.turns[frame]![joints[1]!]!, X)),
    );
    targets(legs, points, motion.fps).forEach((target, frame) => {
      const { thigh, shin } = legs[frame]!.turns(target);
      // the foot keeps its direction
      turned[frame]![joints[0]!] = product(thigh, world.turns[frame]![joints[0]!]!);
      turned[frame]![joints[1]!] = product(shin, world.turns[frame]![joints[1]!]!);
    });
  });
  const root = motion.translations.map((moves) => moves[0]!);
  return { ...motionFrom(HUMANOID, turned, new Map([[0, root]]), motion.fps), travels: motion.travels };
}

/** Where the ankle shall be, of points of the sole over ground at 0. */
function targets(legs: TwoBones[], points: Vector[][], fps: number): Vector[] {
  const shifts = shiftsOf(points, fps);
  const eased = legs.map((leg, at) =>
    leg.eased([leg.ankle[0] + shifts[at]![0], leg.ankle[1], leg.ankle[2] + shifts[at]![1]]),
  );
  const depth = eased.map((target, at) =>
    Math.max(0, -(Math.min(...points[at]!.map((point) => point[1])) + target[1] - legs[at]!.ankle[1])),
  );
  // a mean over the window in which each is the deepest is as high as the one in the middle
  const reach = Math.max(1, rounded(holdSettings.soft * fps));
  const deepest = windows(depth, reach).map((window) => Math.max(...window));
  const bell = Array.from(
    { length: 2 * reach + 1 },
    (_, at) => 0.5 - 0.5 * Math.cos((2 * Math.PI * (at + 1)) / (2 * reach + 2)),
  );
  const total = sumOf(bell);
  return windows(deepest, reach).map((window, at) => {
    const lift = window.reduce((sum, value, i) => sum + value * bell[i]!, 0) / total;
    return [eased[at]![0], eased[at]![1] + Math.min(lift, holdSettings.farthest), eased[at]![2]];
  });
}

/** The shift of a foot over the ground, x and z by frame, that undoes its sliding. */
function shiftsOf(points: Vector[][], fps: number): [number, number][] {
  const touch = contacts(points, fps);
  const strongest = touch.map((row) => Math.max(...row));
  const undone = touch.map((row, at) => {
    const total = Math.max(sumOf(row), 1e-9);
    const step = (axis: 0 | 2) =>
      row.reduce(
        (sum, value, k) => sum + (value / total) * (points[at + 1]![k]![axis] - points[at]![k]![axis]),
        0,
      );
    return [-strongest[at]! * step(0), -strongest[at]! * step(2)];
  });
  const keys = stances(strongest, holdSettings.lifted * fps).map(([start, stop]) => {
    const path = [[0, 0]];
    for (const [x, z] of undone.slice(start, stop)) path.push([path.at(-1)![0]! + x!, path.at(-1)![1]! + z!]);
    const middle = [0, 1].map((axis) => median(path.map((place) => place[axis]!)));
    return { start, values: path.map((place) => place.map((value, axis) => value - middle[axis]!)) };
  });
  return smoothed(blended(keys, points.length, holdSettings.blend * fps), CONTACTS.SOLES.calm * fps).map(
    (shift) => {
      // no longer than the farthest; short ones are as they are within a few per cent
      const factor = (1 + (Math.hypot(...shift) / holdSettings.farthest) ** 4) ** -0.25;
      return [shift[0]! * factor, shift[1]! * factor];
    },
  );
}

/** First and last frame of each stance; those with less between them than a lifted foot are one. */
function stances(contact: number[], lifted: number): [number, number][] {
  const spans: [number, number][] = [];
  contact.forEach((value, at) => {
    if (!(value > 0)) return;
    const last = spans.at(-1);
    if (last && (at === last[1] || at - last[1] < lifted)) last[1] = at + 1;
    else spans.push([at, at + 1]);
  });
  return spans;
}

/** Values that are known in stances, go to 0 between them and come back in so many frames, smoothly. */
function blended(
  stances: { start: number; values: number[][] }[],
  frames: number,
  blend: number,
): number[][] {
  const keys: [at: number, value: number[]][] = [[-2 * blend, [0, 0]]];
  for (const { start, values } of stances) {
    const last = keys.at(-1)![0];
    if (start - last > 2 * blend) keys.push([last + blend, [0, 0]], [start - blend, [0, 0]]);
    values.forEach((value, at) => keys.push([start + at, value]));
  }
  keys.push([keys.at(-1)![0] + blend, [0, 0]]);
  let after = 1;
  return Array.from({ length: frames }, (_, frame) => {
    while (after < keys.length - 1 && keys[after]![0] <= frame) after++;
    const [start, from] = keys[after - 1]!;
    const [end, to] = keys[after]!;
    const part = rise((frame - start) / (end - start), 0, 1);
    return from.map((value, axis) => value + part * (to[axis]! - value));
  });
}
