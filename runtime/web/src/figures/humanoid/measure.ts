/* How a figure stands against the humanoid, measured once: docs/reference/retargeting.md. */
import { MEASURE } from "../../generated.js";
import { alignmentsOfPose, axesAgree, bodyFrame, restsInMotion } from "./alignment.js";
import { Body } from "./body.js";
import { calibrated } from "./calibration.js";
import { MotionError } from "../../errors.js";
import { directionOf, LEG, LEG_LENGTH, partOf, SIDES, SOLES } from "./bones.js";
import { carrierOf, type JointMap, LIMBS, MEASURED } from "./jointMap.js";
import type { World } from "../../motion/motion.js";
import { clamp } from "../../motion/springs.js";
import { extents, median, quantile, spread } from "../../motion/numbers.js";
import {
  AXES,
  cross,
  dot,
  inverse,
  minus,
  plus,
  product,
  type Quaternion,
  RADIANS,
  rotated,
  size,
  STILL,
  swing,
  times,
  unit,
  type Vector,
  X,
  Y,
} from "../../motion/rotations.js";
import type { Skeleton } from "../../motion/skeleton.js";

/** A figure measured against the humanoid. */
export interface Fitted {
  body: Body;
  /** A of each joint: its bone has the rotation G A where it has G in the world. */
  aligned: Quaternion[];
  /** The length of thigh and shin in the skeleton's unit. */
  leg: number;
  /** Of the joints of feet and toes over the sole, in the skeleton's unit. */
  heights: Record<string, number>;
  /** Where y points at rest; null where A does not come from that. */
  up: Vector | null;
  confidence: number;
  notes: string[];
  /** Whether the joint of the hips turns with the legs' joints. */
  pelvis: boolean;
}

/** Measure a figure from its rest pose and its frames; MotionError where it is no human's. */
export function fit(skeleton: Skeleton, map: JointMap, world: World): Fitted {
  const measured = fitted(new Body(skeleton, map), world);
  const hips = map.joints.hips!;
  const axis = rotated(measured.aligned[hips]!, X);
  const cosines = world.turns.map((turned, at) =>
    dot(rotated(turned[hips]!, axis), unit(measured.body.toLeft(world.places[at]!, "UpperLeg"))),
  );
  const apart = Math.acos(clamp(median(cosines), -1, 1)) / RADIANS;
  if (apart <= 30) return { ...measured, pelvis: true };
  const note = `the legs' joints lie ${Math.round(apart)} degrees off the turn of ${skeleton.names[hips]}: the pelvis is turned as they lie`;
  return { ...measured, pelvis: false, notes: [...measured.notes, note] };
}

type Measured = Omit<Fitted, "pelvis">;

function fitted(body: Body, world: World): Measured {
  const { skeleton, map } = body;
  const { turns, places } = world;
  const leg = checkedLeg(body, places[0]!);
  const stands = bodyFrame(skeleton.rest, body);
  const moving = places.length > 1 && restsInMotion(body);
  if (stands && !moving) return fittedAtRest(body, leg, stands);
  const known = axesAgree(body, world);
  const plain = known ? body : new Body(skeleton, { ...map, axes: {} });
  const first = known ? null : bodyFrame(places[0]!, plain, true);
  if (first && (places.length === 1 || isTPose(plain, places[0]!, first))) {
    const aligned = alignmentsOfPose(plain, turns[0]!, places[0]!, first);
    const rise = heightsOver(places[0]!, rotated(first, Y));
    const notes = ["the rest pose is not a standing body: the first frame's pose was used in its place"];
    const rises = heights(plain, leg, rise);
    return { body: plain, aligned, leg, heights: rises, up: null, confidence: 0.95, notes };
  }
  return fittedInFrames(plain, world, leg, known, moving);
}

function fittedAtRest(body: Body, leg: number, stands: Quaternion): Measured {
  const { skeleton, map } = body;
  const points = Object.entries(map.points).map(([bone, at]): [string, Vector] => [bone, unit(at)]);
  const known =
    map.rest !== undefined && agreement(body, skeleton.rest, stands, points) > Math.cos(4 * RADIANS);
  const plain = known || !map.rest ? body : new Body(skeleton, { ...map, rest: undefined });
  const still = skeleton.joints.map(() => STILL);
  const aligned = alignmentsOfPose(plain, still, skeleton.rest, stands);
  const notes = known ? ["the rest pose is one that the convention knows, which was made up for"] : [];
  const up = rotated(stands, Y);
  const rises = heights(plain, leg, heightsOver(skeleton.rest, up));
  return { body: plain, aligned, leg, heights: rises, up, confidence: 1, notes };
}

function fittedInFrames(body: Body, world: World, leg: number, known: boolean, moving: boolean): Measured {
  const { turns, places } = world;
  if (!known) {
    if (places.length < 2)
      throw new MotionError(
        "the rest pose is not a standing body: use a file of this figure that rests in a T-pose",
      );
    checkStance(body, places);
    const left = places.map((pose) => unit(body.toLeft(pose, "UpperLeg")));
    checkFrames(body, places, { left, right: left });
  }
  const guessed = moving && !known;
  const note = guessed
    ? "the rest pose is out of a motion: how the joints stand was guessed from the frames, to 10 or 20 degrees"
    : `the rest pose is not a standing body: how the joints stand was ${known ? "known by the convention" : "found from the frames"}`;
  const aligned = calibrated(body, world, known || !moving);
  const hips = body.map.joints.hips!;
  const carrier = carrierOf(body.map, body.skeleton);
  aligned[carrier] = product(product(inverse(turns[0]![carrier]!), turns[0]![hips]!), aligned[hips]!);
  const confidence = guessed ? 0.7 : known ? 0.95 : 0.85;
  return { body, aligned, leg, heights: heights(body, leg), up: null, confidence, notes: [note] };
}

/** Whether a pose is a T-pose: upright in its frame, and limbs within 16 degrees of the humanoid's. */
function isTPose(body: Body, pose: Vector[], turn: Quaternion): boolean {
  const bones = LIMBS.flatMap((limb) => limb.slice(0, 2)).filter((bone) => body.aimed(bone));
  const limbs = bones.map((bone): [string, Vector] => [bone, directionOf(bone)]);
  return Math.min(agreement(body, pose, turn, limbs), rotated(turn, Y)[1]) > 0.96;
}

/** The least cosine between where bones point in a pose, seen in a frame, and where they are said to. */
function agreement(body: Body, pose: Vector[], turn: Quaternion, points: [string, Vector][]): number {
  return Math.min(1, ...points.map(([bone, along]) => dot(body.direction(pose, bone), rotated(turn, along))));
}

function heightsOver(pose: Vector[], up: Vector): number[] {
  return pose.map((place) => dot(place, up));
}

/** Heights of feet and toes over the sole: over the lowest joint at rest, else as the humanoid's. */
function heights(body: Body, leg: number, rise?: number[]): Record<string, number> {
  const rises: Record<string, number> = {};
  for (const bone of SIDES.flatMap((side) => Object.keys(SOLES).map((part) => side + part))) {
    const joint = body.map.joints[bone];
    if (joint === undefined) continue;
    const usual = (-SOLES[partOf(bone)]![0]![1] * leg) / LEG_LENGTH;
    const below = rise
      ? rise[joint]! - Math.min(...body.skeleton.under(joint).map((under) => rise[under]!))
      : 0;
    rises[bone] = below > 0.3 * usual || bone.endsWith("Toes") ? below : usual;
  }
  return rises;
}

/** Points of the soles in one frame, of the rotations of the humanoid's feet and toes and the figure's positions. */
export function solesOf(
  { body, heights: rises, leg }: Fitted,
  turnOf: (bone: string) => Quaternion,
  pose: Vector[],
): Vector[] {
  const scale = leg / LEG_LENGTH;
  return Object.entries(rises).flatMap(([bone, height]) =>
    SOLES[partOf(bone)]!.map(([x, , z]) =>
      plus(pose[body.map.joints[bone]!]!, rotated(turnOf(bone), [x * scale, -height, z * scale])),
    ),
  );
}

function checkedLeg(body: Body, pose: Vector[]): number {
  const leg = body.legLength(pose);
  const short = MEASURED.filter((bone) => body.aimed(bone) && !(size(body.along(pose, bone)) > 0.02 * leg));
  if (short.length || !(leg > 0))
    throw new MotionError(`bones of length zero: ${short.join(", ")}; a human's limbs have lengths`);
  return leg;
}

/** Metres of one unit of the skeleton, as it says or as the length of its legs tells; null where neither does. */
export function unitOf({ metresPerUnit }: Skeleton, leg: number): { metres: number | null; note?: string } {
  const within = (metres: number, [shortest, longest]: readonly [number, number]) =>
    shortest < leg * metres && leg * metres < longest;
  if (metresPerUnit !== null) {
    if (within(metresPerUnit, MEASURE.POSSIBLE_LEGS)) return { metres: metresPerUnit };
    throw new MotionError(
      `legs of ${(leg * metresPerUnit).toPrecision(3)} m: a human's are ${MEASURE.POSSIBLE_LEGS.join(" to ")} m: the unit of length is wrong`,
    );
  }
  // of the units that make likely legs the one that makes those nearest to an adult's
  const off = (metres: number) => Math.abs(Math.log((leg * metres) / MEASURE.ADULT_LEG));
  const likely = Object.entries(MEASURE.LENGTH_UNITS).filter(([, metres]) =>
    within(metres, MEASURE.LIKELY_LEGS),
  );
  const [name, metres] = likely.sort(([, a], [, b]) => off(a) - off(b))[0] ?? [];
  if (metres === undefined)
    return { metres: null, note: "unit not known: the figure is taken to be an adult's size" };
  return {
    metres,
    note: `unit taken to be ${name} from the length of the legs, ${(leg * metres).toFixed(2)} m`,
  };
}

/** Refuse a figure on four legs. */
function checkStance(body: Body, places: Vector[][]): void {
  const trunk = places.map((pose) => body.trunkUp(pose));
  const above = trunk.map((up, at) => dot(up, body.legsUp(places[at]!)));
  const beside = quantile(above, 0.95) < 0.3;
  const sits = median(trunk.map((up) => up[1])) > 0.5;
  if (beside && !sits)
    throw new MotionError(
      "the trunk never stands above the legs: this looks like a figure on four legs, not like a human's",
    );
}

/** Refuse frames that no human's body goes through; hinges: of each side the knee's axis, to the left, by frame. */
export function checkFrames(body: Body, places: Vector[][], hinges: Record<string, Vector[]>): void {
  const toes: number[] = [];
  let wrong = 0;
  let bent = 0;
  for (const [side, hinge] of Object.entries(hinges)) {
    const [thigh, shin, foot] = LEG.slice(0, 3).map((part) => side + part) as [string, string, string];
    places.forEach((pose, at) => {
      const upper = body.direction(pose, thigh);
      const lower = body.direction(pose, shin);
      if (body.aimed(foot)) toes.push(dot(cross(hinge[at]!, times(lower, -1)), body.direction(pose, foot)));
      const bend = cross(upper, lower);
      if (size(bend) <= MEASURE.BENT) return;
      bent++;
      if (dot(bend, hinge[at]!) < 0 && dot(bend, body.toLeft(pose, "UpperLeg")) < 0) wrong++;
    });
  }
  const backwards = toes.length > 0 && median(toes) < -0.3;
  if (backwards)
    throw new MotionError(
      "the feet point backwards: left and right are swapped, or the frames turn inside out",
    );
  if (bent >= 0.1 * places.length && wrong > 0.6 * bent) {
    throw new MotionError(
      "the knees bend forwards: the frames turn inside out (a wrong order of rotations?), or this is no human",
    );
  }
}

/** The rotation of the world that makes y point up, and what there is to say about it. */
export function upright(
  { body, up: rests, leg }: Fitted,
  places: Vector[][],
): { turn: Quaternion; note?: string } {
  const trunk = places.map((pose) => body.trunkUp(pose));
  if (rests && rests[1] <= 0.5) {
    const stands = median(trunk.map((up) => dot(up, rests))) > 0.7;
    return stands
      ? { turn: swing(rests, Y), note: "turned upright: the figure does not stand along y" }
      : { turn: STILL };
  }
  const up = upOfFrames(body, trunk, places);
  if (!up) return { turn: STILL };
  const name = "xyz"[up.findIndex((part) => part !== 0)];
  const standing = places.filter((_, at) => dot(trunk[at]!, up) > MEASURE.ALONG);
  if (walksAcross(body, leg, up, standing))
    return {
      turn: swing(up, Y),
      note: `turned upright: the frames stand along ${name}, the rest pose along y`,
    };
  const note = `the body lies along ${name} in most frames: if it stands there, export the file with y up`;
  return { turn: STILL, note };
}

/** The direction along x or z in which trunks and legs point in most frames; null where y is up. */
function upOfFrames(body: Body, trunk: Vector[], places: Vector[][]): Vector | null {
  const mean = [0, 1, 2].map((axis) => median(trunk.map((up) => up[axis]!)));
  const axis = mean.map(Math.abs).indexOf(Math.max(...mean.map(Math.abs)));
  const up = times(AXES[axis]!, Math.sign(mean[axis]!));
  const share = (direction: Vector) =>
    trunk.filter((along) => dot(along, direction) > MEASURE.ALONG).length / trunk.length;
  if (axis === 1 || share(up) < 0.5 || share(Y) > 0.1) return null;
  return median(places.map((pose) => dot(body.legsUp(pose), up))) < MEASURE.ALONG ? null : up;
}

/** Whether a figure walks: it goes its leg's length and more across `up`, and not along it. */
function walksAcross(body: Body, leg: number, up: Vector, places: Vector[][]): boolean {
  const path = places.map((pose) => body.middle(pose, "UpperLeg"));
  const rise = spread(path.map((place) => dot(place, up)));
  const flat = path.map((place) => minus(place, times(up, dot(place, up))));
  const extent = Math.hypot(...extents(flat));
  return extent > Math.max(leg, 2 * rise);
}
