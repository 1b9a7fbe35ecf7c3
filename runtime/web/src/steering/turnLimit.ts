/* Joints that turn no faster than people's, as motet/steering/turn_limit.py says. */
import { TURN_LIMIT, type turnSettings } from "../generated.js";
import { BONES } from "../figures/humanoid/bones.js";
import { type Quaternion, setTurn, turnAt } from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";

type Kind = keyof typeof turnSettings;

/** Bones that are limited, and the setting of each. */
const LIMITED = Object.entries(TURN_LIMIT.LIMITED).map(([bone, kind]): [number, Kind] => [
  Number(bone),
  kind as Kind,
]);

/** The joints of a figure as they were shown in the last tick. */
export interface Joints {
  rotations: Float64Array;
  /** Whether there was no tick yet. */
  isNew: boolean;
}

export function newJoints(): Joints {
  return { rotations: new Float64Array(4 * BONES.length), isNew: true };
}

/** Keep the joints of a pose on their way, a tick after the last. */
export function limited(
  joints: Joints,
  { rotations }: Played,
  settings: Settings<typeof turnSettings>,
  seconds: number,
): void {
  const before = joints.rotations;
  for (let i = 0; i < LIMITED.length && !joints.isNew; i++) {
    const [bone, kind] = LIMITED[i]!;
    const half = (settings[kind] * (Math.PI / 180) * seconds) / 2;
    const from = turnAt(before, bone);
    const to = turnAt(rotations, bone);
    const cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
    if (Math.abs(cosine) >= Math.cos(half)) continue;
    setTurn(rotations, bone, turnedBy(from, to, cosine, half));
  }
  before.set(rotations);
  joints.isNew = false;
}

/** A rotation on the shorter way to another, by half an angle. cosine: of half the angle between them. */
function turnedBy(from: Quaternion, to: Quaternion, cosine: number, half: number): Quaternion {
  // what of the goal is square to where the joint was is the axis of the turn
  const aside = to.map((value, i) => value - cosine * from[i]!);
  const by = (Math.sin(half) * (cosine < 0 ? -1 : 1)) / Math.max(Math.hypot(...aside), 1e-12);
  return from.map((value, i) => Math.cos(half) * value + by * aside[i]!) as Quaternion;
}
