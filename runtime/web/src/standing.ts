/* Figures that stand keep their place, and breathe: docs/bundle.md, "Standing". */
import { BONES } from "./humanoid.js";
import type { Playback, Target } from "./matching.js";
import type { Pose as Ground } from "./planar.js";
import { about, inverse, product, type Quaternion, rotated, STILL, X } from "./rotations.js";
import { damped, dampingOf } from "./springs.js";
import type { Played } from "./steering.js";

/** Seconds of a breath. */
const PERIOD = 4;
/** Radians of a breath by which figures differ that are a metre apart, along x and z. */
const WAVE = [2, 3] as const;
/** Radians by which a breath turns the spine to either side. */
const DEPTH = 0.021;
/** The bones of the trunk above the hips, and by how many times its depth a breath turns each about the x axis of the hips. */
const TRUNK = ([["spine", 1], ["chest", 0], ["upperChest", -2]] as const).map(([name, times]) => [BONES.indexOf(name), times] as const);
/** What is turned back, about that axis too. */
const CARRIED = ["neck", "leftShoulder", "rightShoulder"].map((name) => BONES.indexOf(name));
/** Half-life in seconds in which a figure that has come to stand comes to rest and to breathe, or ceases to breathe. */
const SETTLES = 0.3;
/** A figure stands that is told to, goes slower than this in m/s, with contacts of both feet above that. */
const [SLOW, STANDS] = [0.1, 0.5];
/** Share below which nothing is seen of a breath. */
const LEAST = 1e-3;

/** Of one figure. ticks: since it was there. share, rate: how far it has come to rest, from 0 to 1, and how fast that changes. */
export interface Standing {
  ticks: number;
  share: number;
  rate: number;
}

/** Of a figure that has not yet stood. */
export function notYet(): Standing {
  return { ticks: 0, share: 0, rate: 0 };
}

/** A tick later; a figure that stands is kept where it was before it. root: before the tick. acts: whether an act leads the whole body. */
export function kept(standing: Standing, pose: Played, playback: Playback, [x, z]: Ground, target: Target, acts: boolean, dt: number): Played {
  const slow = Math.hypot(playback.spring[0], playback.spring[1]) < SLOW;
  const stands = !target[0] && !target[1] && !acts && slow && pose.contacts.every((contact) => contact > STANDS);
  const goal = stands ? 1 : 0;
  const [off, rate] = damped(standing.share - goal, standing.rate, dampingOf(SETTLES), dt);
  Object.assign(standing, { ticks: standing.ticks + 1, share: goal + off, rate });
  const [toX, toZ, facing] = playback.root;
  const rests = goal * standing.share;
  playback.root = [toX - rests * (toX - x), toZ - rests * (toZ - z), facing];
  return { ...pose, ground: playback.root };
}

/** A pose with its breath. */
export function breathed({ ticks, share }: Standing, pose: Played, dt: number): Played {
  if (share <= LEAST) return pose;
  const [x, z] = pose.ground;
  const angle = DEPTH * share * Math.sin(2 * Math.PI * (((ticks * dt) / PERIOD) % 1) + WAVE[0] * x + WAVE[1] * z);
  const rotations = [...pose.rotations];
  let above: Quaternion = STILL;
  const turn = (bone: number, times: number) => (rotations[bone] = product(about(rotated(inverse(above), X), times * angle), pose.rotations[bone]!));
  for (const [bone, times] of TRUNK) {
    if (times) turn(bone, times);
    above = product(above, pose.rotations[bone]!);
  }
  CARRIED.forEach((bone) => turn(bone, 1));
  return { ...pose, rotations };
}
