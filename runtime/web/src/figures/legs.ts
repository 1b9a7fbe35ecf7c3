/* The inverse kinematics of the humanoid's legs: an ankle brought to a place. */
import { BONES, HUMANOID, LEG, SIDES } from "./humanoid/bones.js";
import { inverse, plus, product, type Quaternion, rotated, type Vector, X } from "../motion/rotations.js";
import { TwoBones } from "./twoBones.js";

/** Of the left and the right leg the bones among the humanoid's. */
export const LEGS = SIDES.map((side) => LEG.map((part) => BONES.indexOf(side + part)));
/** Where the joints of a leg begin in their parents' frames. */
export const OFFSETS = LEGS.map((bones) =>
  bones.map((bone) => HUMANOID.joints[HUMANOID.index(BONES[bone]!)]!.offset),
);
export interface Limb {
  turned: Quaternion[];
  places: Vector[];
}

/** Rotations and places in the world of the joints of a leg. */
export function legOf(rotations: Quaternion[], side: number, hips: Quaternion, root: Vector): Limb {
  let above = hips;
  let place = root;
  const turned: Quaternion[] = [];
  const places: Vector[] = [];
  LEGS[side]!.forEach((bone, joint) => {
    place = plus(place, rotated(above, OFFSETS[side]![joint]!));
    above = product(above, rotations[bone]!);
    turned.push(above);
    places.push(place);
  });
  return { turned, places };
}

/** Turn thigh, shin and foot of a leg so that the ankle is moved; the foot stays as it is in the world. */
export function reach(
  rotations: Quaternion[],
  side: number,
  hips: Quaternion,
  { turned, places }: Limb,
  move: Vector,
): void {
  const [hip, knee, ankle] = places as [Vector, Vector, Vector];
  const [thigh, shin, foot] = turned as [Quaternion, Quaternion, Quaternion];
  const leg = new TwoBones(hip, knee, ankle, rotated(shin, X));
  const turns = leg.turns(leg.eased(plus(ankle, move)));
  const above = product(turns.thigh, thigh);
  const below = product(turns.shin, shin);
  const bones = LEGS[side]!;
  rotations[bones[0]!] = product(inverse(hips), above);
  rotations[bones[1]!] = product(inverse(above), below);
  rotations[bones[2]!] = product(inverse(below), foot);
}
