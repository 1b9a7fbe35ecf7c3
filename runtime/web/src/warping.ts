/* Orientation warping, hips and legs are turned towards where a figure goes and the spine is turned back: docs/bundle.md, the loop `matching`. */
import { BONES, SPINE } from "./humanoid.js";
import { about, inverse, product, type Quaternion, rotated, Y } from "./rotations.js";

/** Which bones turn back, each by the same share. */
const BACK = SPINE.map((name) => BONES.indexOf(name));
/** Radians below which nothing is turned. */
const LEAST = 1e-4;

/** Local rotations with hips and legs turned to the left by an angle; all that the spine carries stays as it is. */
export function warped(rotations: Quaternion[], angle: number): Quaternion[] {
  if (Math.abs(angle) <= LEAST) return rotations;
  const found = [...rotations];
  let above = rotations[0]!;
  found[0] = product(about(Y, angle), above);
  for (const bone of BACK) {
    // about the vertical, as the parent has it
    found[bone] = product(about(rotated(inverse(above), Y), -angle / BACK.length), rotations[bone]!);
    above = product(above, rotations[bone]!);
  }
  return found;
}
