/* The humanoid: the figure of the bundles, with the bones of VRM 1.0 (docs/humanoid.md). */
import { SKELETON } from "../../generated.js";
import tables from "../../../../motet/figures/humanoid/humanoid.json";
import type { Motion, World } from "../../motion/motion.js";
import { quantile } from "../../motion/numbers.js";
import { minus, plus, type Quaternion, rotated, size, unit, type Vector } from "../../motion/rotations.js";
import { type Joint, Skeleton } from "../../motion/skeleton.js";

type Places = Record<string, [parent: string, offset: Vector, order: string]>;

const { trunk, left, fingers, soles } = tables as {
  trunk: Places;
  left: Places;
  fingers: Places;
  soles: Record<string, Vector[]>;
};

export const SIDES = ["left", "right"] as const;
export const SPINE = ["spine", "chest", "upperChest"];
export const NECK = ["neck", "head"];
export const LEG = ["UpperLeg", "LowerLeg", "Foot", "Toes"];
export const ARM = ["Shoulder", "UpperArm", "LowerArm", "Hand"];

/** Points of the sole in the frames of the foot (heel, ball) and of the toes (tip). */
export const SOLES = soles;

/** The bones of a limb on one side, such as those of LEG. */
export function limbOf(side: string, parts: string[]): string[] {
  return parts.map((part) => side + part);
}

/** A bone without its side. */
export function partOf(bone: string): string {
  return bone.replace(/^(left|right)/, "");
}

function added(joints: Joint[], places: Places): Joint[] {
  for (const side of places === trunk ? [""] : SIDES) {
    for (const [part, [above, [x, y, z], order]] of Object.entries(places)) {
      const parent = joints.findIndex(({ name }) => name === side + above || name === above);
      joints.push({ name: side + part, parent, offset: [side === "right" ? -x : x, y, z], order });
    }
  }
  return joints;
}

export const HUMANOID = new Skeleton(added(added([], trunk), left), 1);

/** The humanoid, and after its joints VRM's fingers. */
export const FINGERED = new Skeleton(added([...HUMANOID.joints], fingers), 1);

export const BONES = HUMANOID.names.filter((name) => !name.endsWith(SKELETON.END_SUFFIX));

/** A bone's joint. */
export function jointOf(bone: string): Joint {
  return HUMANOID.joints[HUMANOID.index(bone)]!;
}

/** Where each bone begins in its parent's frame. */
export const OFFSETS = BONES.map((bone) => jointOf(bone).offset);

/** Where a bone of the humanoid points at rest. */
export function directionOf(bone: string): Vector {
  return unit(HUMANOID.joints[HUMANOID.children[HUMANOID.index(bone)]![0]!]!.offset);
}

/** Metres of the humanoid's thigh and shin, the measure by which figures are scaled. */
export const LEG_LENGTH = ["LowerLeg", "Foot"].reduce(
  (sum, part) => sum + size(jointOf(`left${part}`).offset),
  0,
);

/** Points of both soles by frame: of the left foot two, of its toes one, and the same of the right. */
export function solePoints({ turns, places }: World): Vector[][] {
  const points = SIDES.flatMap((side) =>
    Object.entries(SOLES).flatMap(([part, sole]) =>
      sole.map((point): [number, Vector] => [HUMANOID.index(side + part), point]),
    ),
  );
  return turns.map((turned, frame) =>
    points.map(([joint, point]) => plus(places[frame]![joint]!, rotated(turned[joint]!, point))),
  );
}

/** The height of the ground: the lowest point of the soles is deeper in 5 % of the frames. */
export function groundUnder(points: Vector[][]): number {
  const lowest = points.map((frame) => Math.min(...frame.map((point) => point[1])));
  return quantile(lowest, 0.05);
}

/** A motion of it, of local rotations and where the hips are in each frame. */
export function humanoidMotion(rotations: Quaternion[][], hips: Vector[], fps: number): Motion {
  const translations = hips.map((place) => HUMANOID.joints.map(({ offset }, at) => (at ? offset : place)));
  return { skeleton: HUMANOID, fps, rotations, translations, travels: true };
}

/** The hips' joints of both legs. */
export const HIPS = SIDES.map((side) => HUMANOID.index(`${side}UpperLeg`));

/** Whether a skeleton is the humanoid itself, but for the rounding of files. */
export function isHumanoid({ joints, metresPerUnit }: Skeleton): boolean {
  const same = (joint: Joint, at: number) => {
    const expected = HUMANOID.joints[at]!;
    return (
      joint.name === expected.name &&
      joint.parent === expected.parent &&
      (!at || size(minus(joint.offset, expected.offset)) < 1e-6)
    );
  };
  return metresPerUnit === 1 && joints.length === HUMANOID.joints.length && joints.every(same);
}
