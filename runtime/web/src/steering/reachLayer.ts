/* Hands that reach for points: two-bone inverse kinematics of an arm, within what a shoulder can do, as motet/steering/reach_layer.py says. */
import { REACH_LAYER, type reachSettings } from "../generated.js";
import { type Follower, followed, followerAt, shownBy } from "./follower.js";
import { ARM, BONES, OFFSETS, SIDES, SPINE } from "../figures/humanoid/bones.js";
import {
  about,
  dot,
  inverse,
  minus,
  normalised,
  plus,
  product,
  type Quaternion,
  RADIANS,
  rotated,
  setTurn,
  size,
  times,
  turnAt,
  unit,
  type Vector,
  Y,
} from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import { type Played, seenBy } from "./step.js";
import { TwoBones } from "../figures/twoBones.js";

/** Shoulder, upper arm, forearm and hand of both sides. */
const ARMS = SIDES.map((side) => ARM.map((part) => BONES.indexOf(side + part)));
const TRUNK = SPINE.map((name) => BONES.indexOf(name));

/** What a hand of a figure reaches for. aim: where it goes for it, from the shoulder in the frame of the upper chest; weight: [0], the
 *  arm as it is played, to [1]; signs: of the quaternions between which upper arm and forearm are mixed, 1 or -1, 0 at rest; beyond:
 *  whether the point was out of reach in the last tick. */
export interface Reach {
  point: Vector | null;
  aim: Follower;
  weight: Follower;
  signs: [upper: number, lower: number];
  beyond: boolean;
}

/** Of a hand that reaches for nothing. */
export function idle(): Reach {
  return { point: null, aim: followerAt([0, 0, 0]), weight: followerAt([0]), signs: [0, 0], beyond: false };
}

/** Bring the hand of a side of a pose there, a tick after the last; the reach goes on. */
export function reached(
  hand: Reach,
  side: number,
  pose: Played,
  settings: Settings<typeof reachSettings>,
  seconds: number,
): void {
  const rests = hand.weight.wanted[0]! + hand.weight.off[0]! < REACH_LAYER.LEAST_WEIGHT;
  if (!hand.point && rests) {
    hand.beyond = false;
    return;
  }
  // where the hand can be for its point, and whether that can be held
  const arm = armOf(pose, side);
  const goal = hand.point && withinReach(arm, seenBy(TRUNK, pose, hand.point), side, settings);
  const goes = goal?.holds ?? false;
  hand.beyond = !!goal && !(goal.holds && goal.gap <= settings.reached);
  // the aim goes there, or stays while the hand lets go; an arm that does not reach yet goes there by its weight alone
  const wanted = goes ? [...goal!.place] : hand.aim.wanted;
  const aim = rests ? followerAt(wanted) : hand.aim;
  hand.aim = followed(aim, wanted, settings.leap, settings.half_life, seconds);
  hand.weight = followed(hand.weight, [goes ? 1 : 0], 0.5, settings.half_life, seconds);
  // the arm; one that is on its way around one side stays on it
  const { upper, lower } = turned(arm, side, shownBy(hand.aim) as Vector);
  const before = rests ? [0, 0] : hand.signs;
  hand.signs = [sign(arm.upper, upper, before[0]!), sign(arm.lower, lower, before[1]!)];
  const share = shownBy(hand.weight)[0]!;
  const bones = ARMS[side]!;
  setTurn(pose.rotations, bones[1]!, mixed(arm.upper, upper, share, hand.signs[0]));
  setTurn(pose.rotations, bones[2]!, mixed(arm.lower, lower, share, hand.signs[1]));
}

/** An arm as it is played: where its shoulder joint is in the frame of the upper chest; the rotations of collar bone, upper arm and
 *  forearm in their parents' frames; and the arm that is forward and half bent. */
interface Arm {
  start: Vector;
  shoulder: Quaternion;
  upper: Quaternion;
  lower: Quaternion;
  ready: TwoBones;
}

function armOf(pose: Played, side: number): Arm {
  const bones = ARMS[side]!;
  const [shoulder, upper, lower, hand] = bones.map((bone) => turnAt(pose.rotations, bone)) as [
    Quaternion,
    Quaternion,
    Quaternion,
    Quaternion,
  ];
  const offsets = bones.map((bone) => OFFSETS[bone]!);
  const start = plus(offsets[0]!, rotated(shoulder, offsets[1]!));
  const palm = plus(offsets[3]!, rotated(hand, [out(side) * REACH_LAYER.PALM, 0, 0]));
  return { start, shoulder, upper, lower, ready: readied(side, offsets[2]!, palm) };
}

/** The place nearest to a point in the frame of the upper chest where a hand can be, from the shoulder; whether it can be held there,
 *  and the metres that are missing. */
function withinReach(
  { start, ready }: Arm,
  point: Vector,
  side: number,
  settings: Settings<typeof reachSettings>,
): { place: Vector; holds: boolean; gap: number } {
  const way = minus(point, start);
  const place = within(way, side, ready.longest, settings);
  // beyond the edge a place would go round the shoulder faster than the point, and near it both do
  const far = size(way);
  const widest = Math.min(settings.widest + settings.lets_go, Math.PI);
  const isAhead = dot(way, diagonal(side)) >= Math.cos(widest) * far;
  const holds = isAhead && far > settings.nearest * ready.longest;
  return { place, holds, gap: size(minus(place, way)) };
}

/** Rotations of an upper arm and a forearm in their parents' frames with the hand at a place, from the shoulder. */
function turned(
  { shoulder, ready }: Arm,
  side: number,
  place: Vector,
): { upper: Quaternion; lower: Quaternion } {
  const { thigh, shin } = ready.turns(place);
  const up = product(thigh, READY[side]![0]);
  const low = product(shin, READY[side]![1]);
  return { upper: product(inverse(shoulder), up), lower: product(inverse(up), low) };
}

/** 1 for the left side, which is at positive x, -1 for the right. */
function out(side: number): number {
  return 1 - 2 * side;
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
  const hand = plus(elbow, rotated(lower, down));
  return new TwoBones([0, 0, 0], elbow, hand, rotated(lower, times(Y, -out(side))));
}

/** The place nearest to one, from the shoulder, that an arm of a length reaches, turned and stretched no farther than it can be. */
function within(
  way: Vector,
  side: number,
  longest: number,
  settings: Settings<typeof reachSettings>,
): Vector {
  const widest = Math.cos(settings.widest);
  const axis = diagonal(side);
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

/** The direction diagonally forward, on a side. */
function diagonal(side: number): Vector {
  return unit([out(side), 0, 1]);
}

/** The sign of the first quaternion beside the second: that of the shorter way from a rest, then as in the last tick, unless this
 *  way has become too far around. */
function sign(first: Quaternion, second: Quaternion, before: number): number {
  const cosine = first.reduce((sum, value, i) => sum + value * second[i]!, 0);
  return before === 0 || cosine * before < REACH_LAYER.WRAP_COSINE ? (cosine < 0 ? -1 : 1) : before;
}

/** A rotation between two, by a share of the way. side: the sign of the first quaternion. */
function mixed(first: Quaternion, second: Quaternion, share: number, side: number): Quaternion {
  return normalised(first.map((value, i) => (1 - share) * side * value + share * second[i]!) as Quaternion);
}
