/* A of joints from frames, where the rest pose is no body's: docs/reference/retargeting.md, "Rest poses that do not stand". */
import { ALIGNMENT } from "../../generated.js";
import { frame, knownAxes, meanDirection, nearAxes } from "./alignment.js";
import type { Body } from "./body.js";
import { ARM, directionOf, LEG, limbOf, SIDES } from "./bones.js";
import type { World } from "../../motion/motion.js";
import {
  cross,
  inverse,
  minus,
  normalised,
  plus,
  product,
  type Quaternion,
  rotated,
  STILL,
  swing,
  times,
  unit,
  type Vector,
  X,
  Y,
  Z,
} from "../../motion/rotations.js";

/** A of all joints that are bones; alongAxes: whether joints have axes along bones and hinges. */
export function calibrated(body: Body, world: World, alongAxes: boolean): Quaternion[] {
  const calibration = new Calibration(body, world, alongAxes);
  calibration.trunk();
  // each stage builds on the joints settled before: trunk, then legs from the hips, and arms from the chest
  SIDES.forEach((side, at) => {
    calibration.leg(limbOf(side, LEG));
    calibration.arm(limbOf(side, ARM), at ? -1 : 1);
  });
  return calibration.aligned;
}

class Calibration {
  readonly aligned: Quaternion[];

  constructor(
    private readonly body: Body,
    private readonly world: World,
    private readonly alongAxes: boolean,
  ) {
    this.aligned = body.skeleton.joints.map(() => STILL);
  }

  private turnsOf(joint: number): Quaternion[] {
    return this.world.turns.map((turned) => turned[joint]!);
  }

  /** Rotations of the humanoid's bone for a joint whose A is found. */
  private turned(joint: number): Quaternion[] {
    return this.turnsOf(joint).map((turn) => product(turn, this.aligned[joint]!));
  }

  private directions(bone: string): Vector[] {
    return this.world.places.map((pose) => this.body.direction(pose, bone));
  }

  /** A from estimates of the bone's rotation: what the convention says, or near axes, or the mean. */
  private settle(joint: number, turns: Quaternion[]): void {
    const known = this.body.map.axes[joint];
    const mean = known
      ? STILL
      : meanTurn(this.turnsOf(joint).map((turn, at) => product(inverse(turn), turns[at]!)));
    this.aligned[joint] = known ? knownAxes(known) : this.alongAxes ? nearAxes(mean, 30) : mean;
  }

  /** The same for a bone of a limb, which then also points where it really does. */
  private settleLimb(bone: string, along: Vector[], turns: Quaternion[]): void {
    const joint = this.body.map.joints[bone]!;
    this.settle(joint, turns);
    const local = meanDirection(this.turnsOf(joint), along);
    // feet count that lie along an axis of their joint
    if (/(Foot|Toes)$/.test(bone) && !(Math.max(...local.map(Math.abs)) > 0.995)) return;
    const start = rotated(this.aligned[joint]!, directionOf(bone));
    this.aligned[joint] = product(swing(start, local), this.aligned[joint]!);
  }

  /** Hips and back: up towards the arms; the joint that carries the arms and those above: up towards the head. */
  trunk(): void {
    const { body } = this;
    const { places } = this.world;
    const { joints, spine, neck } = body.map;
    const above = joints.head === undefined ? neck : [...neck, joints.head];
    const back = [joints.hips!, ...spine, ...above];
    const chest = spine.length;
    back.forEach((joint, i) => {
      const turns = places.map((pose) => {
        // left goes over from that of the legs to that of the arms
        const legs = unit(body.toLeft(pose, "UpperLeg"));
        const arms = unit(body.toLeft(pose, "UpperArm"));
        const left = i < chest ? plus(times(legs, 1 - i / chest), times(arms, i / chest)) : arms;
        return frame(left, this.up(pose, i, back, chest));
      });
      this.settle(joint, turns);
    });
  }

  /** Up from the i-th joint of the back; from the joint below to the last. */
  private up(pose: Vector[], i: number, back: number[], chest: number): Vector {
    if (i === back.length - 1) return minus(pose[back[i]!]!, pose[back[Math.max(i - 1, chest - 1)]!]!);
    const start = i ? pose[back[i]!]! : this.body.middle(pose, "UpperLeg");
    const end = i < chest ? this.body.middle(pose, "UpperArm") : pose[back.at(-1)!]!;
    return minus(end, start);
  }

  /** Knees are hinges that bend backwards; feet and toes have the hinge's axis. */
  leg([upperLeg, lowerLeg, ...footAndToes]: string[]): void {
    const { joints } = this.body.map;
    const thigh = this.directions(upperLeg!);
    const shin = this.directions(lowerLeg!);
    const hips = this.turned(joints.hips!);
    const hinge = thigh.map((along, at) =>
      plus(cross(along, shin[at]!), times(rotated(hips[at]!, X), ALIGNMENT.HINGE)),
    );
    const about = (along: Vector[]) => hinge.map((axis, at) => frame(axis, times(along[at]!, -1)));
    this.settleLimb(upperLeg!, thigh, about(thigh));
    this.settleLimb(lowerLeg!, shin, about(shin));
    for (const bone of footAndToes) {
      if (joints[bone] !== undefined) this.foot(bone, this.turned(joints[lowerLeg!]!));
    }
  }

  /** A foot, or toes, slopes against the level as the humanoid's does; without a direction it turns with the shin. */
  private foot(bone: string, shins: Quaternion[]): void {
    if (!this.body.aimed(bone)) return this.settle(this.body.map.joints[bone]!, shins);
    const along = this.directions(bone);
    const slope = inverse(swing(Z, directionOf(bone)));
    const turns = along.map((direction, at) => {
      const left = rotated(shins[at]!, X);
      return product(frame(left, cross(direction, left)), slope);
    });
    this.settleLimb(bone, along, turns);
  }

  /** Elbows are hinges that bend forwards with the arms out to the sides; hands are in line with the forearms. */
  arm([shoulder, upperArm, lowerArm, hand]: string[], sign: number): void {
    const { body } = this;
    const { joints, spine } = body.map;
    const chest = this.turned(spine.at(-1)!);
    if (joints[shoulder!] !== undefined) this.settle(joints[shoulder!]!, chest);
    const upper = this.directions(upperArm!);
    const lower = body.aimed(lowerArm!) ? this.directions(lowerArm!) : upper;
    const up = upper.map((along, at) => {
      const plain = product(swing(rotated(chest[at]!, directionOf(upperArm!)), along), chest[at]!);
      return plus(times(cross(along, lower[at]!), -sign), times(rotated(plain, Y), ALIGNMENT.HINGE));
    });
    const level = (along: Vector[], ups: Vector[]) =>
      along.map((axis, at) => frame(times(axis, sign), ups[at]!, false));
    this.settleLimb(upperArm!, upper, level(upper, up));
    this.settleLimb(lowerArm!, lower, level(lower, up));
    if (joints[hand!] === undefined) return;
    const forearm = this.turned(joints[lowerArm!]!);
    if (!body.aimed(hand!)) return this.settle(joints[hand!]!, forearm);
    const along = this.directions(hand!);
    const ups = forearm.map((turn) => rotated(turn, Y));
    this.settleLimb(hand!, along, level(along, ups));
  }
}

/** The rotation nearest to all: the eigenvector of the sum of q q^T of the largest eigenvalue, found by squaring it. */
function meanTurn(turns: Quaternion[]): Quaternion {
  let matrix = [0, 1, 2, 3].map((i) =>
    [0, 1, 2, 3].map((j) => turns.reduce((sum, turn) => sum + turn[i]! * turn[j]!, 0)),
  );
  for (let round = 0; round < 40; round++) {
    const largest = Math.max(...matrix.flat().map(Math.abs));
    const scaled = matrix.map((row) => row.map((value) => value / largest));
    matrix = scaled.map((row) =>
      scaled.map((_, j) => row.reduce((sum, value, k) => sum + value * scaled[k]![j]!, 0)),
    );
  }
  const widest = matrix.reduce((best, row) => (Math.hypot(...row) > Math.hypot(...best) ? row : best));
  return normalised(widest as Quaternion);
}
