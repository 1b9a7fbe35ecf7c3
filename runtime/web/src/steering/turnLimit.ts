/* Joints that turn no faster than people's, as motet/steering/turn_limit.py says. */
import { TURN_LIMIT, type turnSettings } from "../generated.js";
import type { Quaternion } from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";

type Kind = keyof typeof turnSettings;

/** Bones that are limited, and the setting of each. */
const LIMITED = Object.entries(TURN_LIMIT.LIMITED).map(([bone, kind]): [number, Kind] => [
  Number(bone),
  kind as Kind,
]);

/** The joints of a figure as they were shown in the last tick, null before the first. */
export interface Joints {
  rotations: Quaternion[] | null;
}

/** A pose with joints that are on their way, a tick after the last. */
export function limited(
  joints: Joints,
  pose: Played,
  settings: Settings<typeof turnSettings>,
  seconds: number,
): Played {
  const before = joints.rotations;
  joints.rotations = pose.rotations;
  if (!before) return pose;
  for (const [bone, kind] of LIMITED) {
    const half = (settings[kind] * (Math.PI / 180) * seconds) / 2;
    const from = before[bone]!;
    const to = pose.rotations[bone]!;
    const cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
    if (Math.abs(cosine) >= Math.cos(half)) continue;
    if (joints.rotations === pose.rotations) joints.rotations = [...pose.rotations];
    joints.rotations[bone] = turnedBy(from, to, cosine, half);
  }
  return { ...pose, rotations: joints.rotations };
}

/** A rotation on the shorter way to another, by half an angle. cosine: of half the angle between them. */
function turnedBy(from: Quaternion, to: Quaternion, cosine: number, half: number): Quaternion {
  // what of the goal is square to where the joint was is the axis of the turn
  const aside = to.map((value, i) => value - cosine * from[i]!);
  const by = (Math.sin(half) * (cosine < 0 ? -1 : 1)) / Math.max(Math.hypot(...aside), 1e-12);
  return from.map((value, i) => Math.cos(half) * value + by * aside[i]!) as Quaternion;
}
