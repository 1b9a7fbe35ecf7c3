/* Hands that reach for points: two-bone inverse kinematics of an arm, within what a shoulder can do, as motet/steering/reach_layer.py says. */
import { REACH_LAYER, type reachSettings } from "../generated.js";
import { type Follower, followed, followerAt, shownBy } from "./follower.js";
import { ARM, BONES, HUMANOID, SIDES, SPINE } from "../figures/humanoid/bones.js";
import {
  about,
  dot,
  inverse,
  minus,
  normalised,
  plus,
  product,
  type Quaternion,
  rotated,
  size,
  times,
  unit,
  type Vector,
  Y,
} from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";
import { TwoBones } from "../figures/twoBones.js";

/** Shoulder, upper arm, forearm and hand of both sides. */
const ARMS = SIDES.map((side) => ARM.map((part) => BONES.indexOf(side + part)));
const OFFSETS = BONES.map((name) => HUMANOID.joints[HUMANOID.index(name)]!.offset);
const TRUNK = SPINE.map((name) => BONES.indexOf(name));
const RADIANS = Math.PI / 180;

/** What a hand of a figure reaches for. aim: where it goes for it; weight: [0], the arm as it is played, to [1]; beyond: whether
 *  the point was out of reach in the last tick. */
export interface Reach {
  point: Vector | null;
  aim: Follower;
  weight: Follower;
  beyond: boolean;
}

/** Of a hand that reaches for nothing. */
export function idle(): Reach {
  return { point: null, aim: followerAt([0, 0, 0]), weight: followerAt([0]), beyond: false };
}

/** A pose with the hand of a side there, a tick after the last; the reach goes on. */
export function reached(
  hand: Reach,
  side: number,
  pose: Played,
  settings: Settings<typeof reachSettings>,
  seconds: number,
): Played {
  const rests = shownBy(hand.weight)[0]! < REACH_LAYER.LEAST;
  if (!hand.point && rests) return pose;
  const wanted = hand.point ?? hand.aim.wanted;
  // an arm that does not reach yet goes to the point by its weight alone
  hand.aim = followed(
    rests ? followerAt([...wanted]) : hand.aim,
    [...wanted],
    settings.leap,
    settings.half_life,
    seconds,
  );
  hand.weight = followed(hand.weight, [hand.point ? 1 : 0], 0.5, settings.half_life, seconds);
  const { upper, lower, gap } = arm(pose, side, shownBy(hand.aim) as Vector, settings);
  hand.beyond = !!hand.point && gap > settings.reached;
  const rotations = [...pose.rotations];
  const share = shownBy(hand.weight)[0]!;
  const bones = ARMS[side]!;
  rotations[bones[1]!] = mixed(rotations[bones[1]!]!, upper, share);
  rotations[bones[2]!] = mixed(rotations[bones[2]!]!, lower, share);
  return { ...pose, rotations };
}

/** Rotations of an upper arm and a forearm in their parents' frames with the hand at a point, and the metres that are missing. */
function arm(
  pose: Played,
  side: number,
  point: Vector,
  settings: Settings<typeof reachSettings>,
): { upper: Quaternion; lower: Quaternion; gap: number } {
  const bones = ARMS[side]!;
  const [shoulder, , , hand] = bones.map((bone) => pose.rotations[bone]!) as [
    Quaternion,
    Quaternion,
    Quaternion,
    Quaternion,
  ];
  const offsets = bones.map((bone) => OFFSETS[bone]!);
  const start = plus(offsets[0]!, rotated(shoulder, offsets[1]!));
  const way = minus(inChest(pose, point), start);
  const ready = readied(
    side,
    offsets[2]!,
    plus(offsets[3]!, rotated(hand, [out(side) * REACH_LAYER.PALM, 0, 0])),
  );
  const near = within(way, side, ready.longest, settings);
  const { thigh, shin } = ready.turns(near);
  const up = product(thigh, READY[side]![0]);
  const low = product(shin, READY[side]![1]);
  return {
    upper: product(inverse(shoulder), up),
    lower: product(inverse(up), low),
    gap: size(minus(near, way)),
  };
}

/** 1 for the left side, which is at positive x, -1 for the right. */
function out(side: number): number {
  return 1 - 2 * side;
}

/** A point in the frame of the upper chest. */
function inChest({ ground: [x, z, facing], height, rotations }: Played, point: Vector): Vector {
  let place: Vector = [x, height, z];
  let above: Quaternion = product(about(Y, facing), rotations[0]!);
  for (const bone of TRUNK) {
    place = plus(place, rotated(above, OFFSETS[bone]!));
    above = product(above, rotations[bone]!);
  }
  return rotated(inverse(above), minus(point, place));
}

/** The upper arm and the forearm that are forward and half bent, with the elbow down: bent by a right angle, then turned. */
const READY = SIDES.map((_, side): [Quaternion, Quaternion] => {
  const upper = about(unit([out(side), 0, 1]), -75 * out(side) * RADIANS);
  return [upper, product(upper, about([0, -out(side), 0], 90 * RADIANS))];
});

/** That arm in the frame of the upper chest, from the shoulder; of an upper arm and a forearm with the hand, in their own frames. */
function readied(side: number, along: Vector, down: Vector): TwoBones {
  const [upper, lower] = READY[side]!;
  const elbow = rotated(upper, along);
  return new TwoBones(
    [0, 0, 0],
    elbow,
    plus(elbow, rotated(lower, down)),
    rotated(lower, times(Y, -out(side))),
  );
}

/** The place nearest to one, from the shoulder, that an arm of a length reaches, turned and stretched no farther than it can be. */
function within(
  way: Vector,
  side: number,
  longest: number,
  settings: Settings<typeof reachSettings>,
): Vector {
  const widest = Math.cos(settings.widest);
  const axis = unit([out(side), 0, 1]);
  const far = size(way);
  const along = dot(way, axis);
  const aside = unit(minus(way, times(axis, along)));
  const edge = plus(times(axis, widest * far), times(aside, Math.sqrt(1 - widest * widest) * far));
  const nearest = settings.nearest * longest;
  const straight = settings.straight * longest;
  const more = settings.stretched * longest;
  const over = Math.max(far - straight, 0);
  const eased = over > 0 ? straight + more * (1 - Math.exp(-over / more)) : Math.max(far, nearest);
  return times(along >= widest * far ? way : edge, eased / Math.max(far, 1e-12));
}

/** A rotation between two, by a share of the way. */
function mixed(first: Quaternion, second: Quaternion, share: number): Quaternion {
  const near = first.reduce((sum, value, i) => sum + value * second[i]!, 0) < 0 ? -1 : 1;
  return normalised(first.map((value, i) => (1 - share) * near * value + share * second[i]!) as Quaternion);
}
