/* Figures that stand keep their place, and breathe: docs/reference/bundle.md, "Standing". */
import { IDLE, type idleSettings } from "../generated.js";
import type { Playback, Target } from "./matching.js";
import { lengthOf, type Pose as Ground } from "../motion/planar.js";
import {
  about,
  inverse,
  product,
  type Quaternion,
  rotated,
  setTurn,
  STILL,
  turnAt,
  X,
} from "../motion/rotations.js";
import { damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import { place, type Played } from "./step.js";

/** The bones that a breath turns about the x axis of the hips, and by how many times its depth. */
const TURNS = Object.entries(IDLE.BREATH_TURNS).map(([bone, times]) => ({ bone: Number(bone), times }));
/** Those of the trunk above the hips. */
const TRUNK: readonly number[] = IDLE.TRUNK_BONES;

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

/** A tick later; keep a figure that stands where it was before it. root: before the tick. acts: whether an act leads the whole body. */
export function kept(
  standing: Standing,
  pose: Played,
  playback: Playback,
  [x, z]: Ground,
  target: Target,
  acts: boolean,
  settings: Settings<typeof idleSettings>,
  dt: number,
): void {
  const slow = lengthOf(playback.spring[0], playback.spring[1]) < settings.slow;
  const isDown = Math.min(pose.contacts[0], pose.contacts[1]) > settings.stands;
  const stands = !target[0] && !target[1] && !acts && slow && isDown;
  const goal = stands ? 1 : 0;
  const [off, rate] = damped(standing.share - goal, standing.rate, dampingOf(settings.settles), dt);
  standing.ticks++;
  standing.share = goal + off;
  standing.rate = rate;
  const rests = goal * standing.share;
  playback.root[0] -= rests * (playback.root[0] - x);
  playback.root[1] -= rests * (playback.root[1] - z);
  place(pose, playback);
}

/** Let a pose breathe. */
export function breathed(
  { ticks, share }: Standing,
  pose: Played,
  settings: Settings<typeof idleSettings>,
  dt: number,
): void {
  if (share <= IDLE.LEAST_BREATH) return;
  const [x, z] = pose.ground;
  const angle =
    settings.depth *
    share *
    Math.sin(
      2 * Math.PI * (((ticks * dt) / settings.breath) % 1) + settings.wave_x * x + settings.wave_z * z,
    );
  const { rotations } = pose;
  let above: Quaternion = STILL;
  for (const { bone, times } of TURNS) {
    const local = turnAt(rotations, bone);
    if (times) setTurn(rotations, bone, product(about(rotated(inverse(above), X), times * angle), local));
    if (TRUNK.includes(bone)) above = product(above, local);
  }
}
