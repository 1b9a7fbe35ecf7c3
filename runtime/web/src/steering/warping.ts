/* Legs go another way, hips turned with them and the spine back, and with other strides: docs/reference/bundle.md, the loop `matching`. */
import { WARPING } from "../generated.js";
import { BONES, HUMANOID, SIDES, SOLES, SPINE } from "../figures/humanoid/bones.js";
import { LEG_OFFSETS, legOf, reach } from "../figures/legs.js";
import { about, inverse, plus, product, rotated, setTurn, turnAt, Y } from "../motion/rotations.js";

/** Which bones turn back, each by the same share. */
const BACK = SPINE.map((name) => BONES.indexOf(name));

/** Turn hips and legs of local rotations to the left by an angle; all that the spine carries stays as it is. */
export function warped(rotations: Float64Array, angle: number): void {
  if (Math.abs(angle) <= WARPING.LEAST_CHANGE) return;
  let above = turnAt(rotations, 0);
  setTurn(rotations, 0, product(about(Y, angle), above));
  for (const bone of BACK) {
    const local = turnAt(rotations, bone);
    // about the vertical, as the parent has it
    setTurn(rotations, bone, product(about(rotated(inverse(above), Y), -angle / BACK.length), local));
    above = product(above, local);
  }
}

/** Of the sole, in the frame of the foot. */
const BALL = SOLES.Foot!.at(-1)!;
/** How far in front of the hips the balls of a standing figure's feet are. */
const UNDER = HUMANOID.rest[HUMANOID.index("leftFoot")]![2] + BALL[2];

/**
 * Lead the balls of the feet of local rotations so far that strides are this times as long, in whichever direction they
 * go: one that changed with the row that is played would make feet leap.
 */
export function strided(rotations: Float64Array, stride: number): void {
  if (Math.abs(stride - 1) <= WARPING.LEAST_CHANGE) return;
  const hips = turnAt(rotations, 0);
  for (let side = 0; side < SIDES.length; side++) {
    const leg = legOf(rotations, side, hips, [0, 0, 0]);
    const [x, , z] = plus(leg.places[2]!, rotated(leg.turned[2]!, BALL));
    const [hipX] = LEG_OFFSETS[side]![0]!;
    reach(rotations, side, hips, leg, [(x - hipX) * (stride - 1), 0, (z - UNDER) * (stride - 1)]);
  }
}
