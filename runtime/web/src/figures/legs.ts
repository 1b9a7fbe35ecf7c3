/* The inverse kinematics of the humanoid's legs: an ankle brought to a place. */
import { BONES, LEG, OFFSETS, SIDES } from "./humanoid/bones.js";
import {
  inverse,
  plus,
  product,
  type Quaternion,
  rotated,
  setTurn,
  turnAt,
  type Vector,
  X,
} from "../motion/rotations.js";
import { TwoBones } from "./twoBones.js";

/** Of the left and the right leg the bones among the humanoid's. */
const LEGS = SIDES.map((side) => LEG.map((part) => BONES.indexOf(side + part)));
/** Where the joints of a leg begin in their parents' frames. */
export const LEG_OFFSETS = LEGS.map((bones) => bones.map((bone) => OFFSETS[bone]!));

/** Of hip, knee, ankle and toes. */
export interface Limb {
  turned: [thigh: Quaternion, shin: Quaternion, foot: Quaternion, toes: Quaternion];
  places: [hip: Vector, knee: Vector, ankle: Vector, toes: Vector];
}

/** Rotations and places in the world of the joints of a leg. */
export function legOf(rotations: Float64Array, side: number, hips: Quaternion, root: Vector): Limb {
  const bones = LEGS[side]!;
  const offsets = LEG_OFFSETS[side]!;
  const hip = plus(root, rotated(hips, offsets[0]!));
  const thigh = product(hips, turnAt(rotations, bones[0]!));
  const knee = plus(hip, rotated(thigh, offsets[1]!));
  const shin = product(thigh, turnAt(rotations, bones[1]!));
  const ankle = plus(knee, rotated(shin, offsets[2]!));
  const foot = product(shin, turnAt(rotations, bones[2]!));
  const toes = plus(ankle, rotated(foot, offsets[3]!));
  return {
    turned: [thigh, shin, foot, product(foot, turnAt(rotations, bones[3]!))],
    places: [hip, knee, ankle, toes],
  };
}

/** Turn thigh, shin and foot of a leg so that the ankle is moved; the foot stays as it is in the world. */
export function reach(
  rotations: Float64Array,
  side: number,
  hips: Quaternion,
  { turned, places }: Limb,
  move: Vector,
): void {
  const leg = new TwoBones(places[0], places[1], places[2], rotated(turned[1], X));
  const turns = leg.turns(leg.eased(plus(places[2], move)));
  const above = product(turns.thigh, turned[0]);
  const below = product(turns.shin, turned[1]);
  const bones = LEGS[side]!;
  setTurn(rotations, bones[0]!, product(inverse(hips), above));
  setTurn(rotations, bones[1]!, product(inverse(above), below));
  setTurn(rotations, bones[2]!, product(inverse(below), turned[2]));
}
