/* Joints that turn no faster than people's, as motet/steering/turn_limit.py says. */
import { TURN_LIMIT, turnSettings } from "../generated.js";
import { BONES } from "../figures/humanoid/bones.js";
import { type Quaternion, RADIANS, setTurn, turnAt } from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";

type Kind = keyof typeof turnSettings;

/** Of each setting the bones that it limits. */
const LIMITED = (Object.keys(turnSettings) as Kind[]).map((kind): [Kind, number[]] => [
  kind,
  Object.entries(TURN_LIMIT.LIMITED).flatMap(([bone, name]) => (name === kind ? [Number(bone)] : [])),
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
    const [kind, bones] = LIMITED[i]!;
    const half = (settings[kind] * RADIANS * seconds) / 2;
    const least = Math.cos(half);
    for (let j = 0; j < bones.length; j++) {
      const bone = bones[j]!;
      const cosine = cosineAt(before, rotations, 4 * bone);
      if (Math.abs(cosine) >= least) continue;
      setTurn(rotations, bone, turnedBy(turnAt(before, bone), turnAt(rotations, bone), cosine, half));
    }
  }
  before.set(rotations);
  joints.isNew = false;
}

/** The cosine of half the angle between the quaternions at a place. */
function cosineAt(from: Float64Array, to: Float64Array, at: number): number {
  return (
    from[at]! * to[at]! +
    from[at + 1]! * to[at + 1]! +
    from[at + 2]! * to[at + 2]! +
    from[at + 3]! * to[at + 3]!
  );
}

/** A rotation on the shorter way to another, by half an angle. cosine: of half the angle between them. */
function turnedBy(from: Quaternion, to: Quaternion, cosine: number, half: number): Quaternion {
  // what of the goal is square to where the joint was is the axis of the turn
  const aside = to.map((value, i) => value - cosine * from[i]!);
  const by = (Math.sin(half) * (cosine < 0 ? -1 : 1)) / Math.max(Math.hypot(...aside), 1e-12);
  return from.map((value, i) => Math.cos(half) * value + by * aside[i]!) as Quaternion;
}
