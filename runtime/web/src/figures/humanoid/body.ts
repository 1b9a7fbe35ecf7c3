import { LEG, SIDES } from "./bones.js";
import { type JointMap, LIMBS } from "./jointMap.js";
import { dot, mean, minus, plus, size, unit, type Vector } from "../../motion/rotations.js";
import type { Skeleton } from "../../motion/skeleton.js";

/** A skeleton and which of its joints are bones: where bones point, of a pose (the positions of all joints). */
export class Body {
  /** Bone of a limb -> the joints whose mean place it points to; none if none. */
  readonly aims: Record<string, number[]> = {};

  constructor(
    readonly skeleton: Skeleton,
    readonly map: JointMap,
  ) {
    for (const limb of LIMBS) {
      limb.forEach((bone, at) => {
        const joint = map.joints[bone];
        const after = map.joints[limb[at + 1] ?? ""];
        if (joint !== undefined) this.aims[bone] = after === undefined ? this.ends(joint) : [after];
      });
    }
    for (const side of SIDES) {
      const [shin, foot, toes] = LEG.slice(1).map((part) => side + part) as [string, string, string];
      if (!this.aims[foot]?.length || map.joints[toes] !== undefined) continue;
      // a foot without toes that continues the shin within 15 degrees, as in old files, has no direction of its own
      const cosine = dot(this.direction(skeleton.rest, shin), this.direction(skeleton.rest, foot));
      if (cosine > Math.cos((15 * Math.PI) / 180)) this.aims[foot] = [];
    }
  }

  /** The joints after one, but the thumb, that lie apart from it. */
  private ends(joint: number): number[] {
    const { joints, children, names } = this.skeleton;
    const after = children[joint]!.filter((child) => !names[child]!.toLowerCase().includes("thumb"));
    const apart = after.filter((child) => size(joints[child]!.offset) > 0);
    return apart.length ? apart : (after.map((child) => this.ends(child)).find((ends) => ends.length) ?? []);
  }

  /** Whether it is known where a bone points. */
  aimed(bone: string): boolean {
    return !!this.aims[bone]?.length;
  }

  /** From a bone's joint to the middle of what it points to. */
  along(pose: Vector[], bone: string): Vector {
    return minus(mean(this.aims[bone]!.map((end) => pose[end]!)), pose[this.map.joints[bone]!]!);
  }

  direction(pose: Vector[], bone: string): Vector {
    return unit(this.along(pose, bone));
  }

  private pair(pose: Vector[], part: string): Vector[] {
    return SIDES.map((side) => pose[this.map.joints[side + part]!]!);
  }

  /** The middle between a joint of the left and its partner. */
  middle(pose: Vector[], part: string): Vector {
    return mean(this.pair(pose, part));
  }

  /** From a joint of the right to its partner on the left. */
  toLeft(pose: Vector[], part: string): Vector {
    const [left, right] = this.pair(pose, part);
    return minus(left!, right!);
  }

  /** The direction from the middle of the legs' joints to that of the arms'. */
  trunkUp(pose: Vector[]): Vector {
    return unit(minus(this.middle(pose, "UpperArm"), this.middle(pose, "UpperLeg")));
  }

  /** The direction from the feet to the legs' joints, the mean of both sides. */
  legsUp(pose: Vector[]): Vector {
    const hips = this.pair(pose, "UpperLeg");
    const feet = this.pair(pose, "Foot");
    return unit(plus(unit(minus(hips[0]!, feet[0]!)), unit(minus(hips[1]!, feet[1]!))));
  }

  /** The length of thigh and shin, the mean of both sides. */
  legLength(pose: Vector[]): number {
    const length = (bone: string) => size(this.along(pose, bone));
    return SIDES.reduce((sum, side) => sum + (length(`${side}UpperLeg`) + length(`${side}LowerLeg`)) / 2, 0);
  }
}
