/* Motions of any human figure to the humanoid and back: docs/reference/retargeting.md. */
import { SKELETON } from "../../generated.js";
import { MotionError } from "../../errors.js";
import { relaxed } from "./fingers.js";
import {
  BONES,
  groundUnder,
  HIPS,
  HUMANOID,
  isHumanoid,
  jointOf,
  LEG_LENGTH,
  NECK,
  SIDES,
  solePoints,
  SPINE,
} from "./bones.js";
import { carrierOf, type JointMap, mapFrom, mapOf } from "./jointMap.js";
import { checkFrames, fit, type Fitted, solesOf, unitOf, upright } from "./measure.js";
import {
  atRest,
  checked,
  cut,
  type Motion,
  motionFrom,
  placesOf,
  type World,
  worldOf,
} from "../../motion/motion.js";
import {
  about,
  inverse,
  mean,
  minus,
  plus,
  product,
  type Quaternion,
  rotated,
  STILL,
  swing,
  times,
  towards,
  twist,
  type Vector,
  X,
  Y,
  Z,
} from "../../motion/rotations.js";
import type { Skeleton } from "../../motion/skeleton.js";

/** Bones and the names of their joints: a string, or of spine and neck a list, upwards. */
export type NamedJoints = Record<string, string | string[]>;

/** A skeleton as it was measured against the humanoid. */
export interface Figure {
  fitted: Fitted;
  /** One frame of it. */
  first: Motion;
}

/** A motion on the humanoid, and what was found on the way. */
export interface Humanoid {
  motion: Motion;
  convention: string;
  /** From 0 to 1, how sure it is that every joint was taken for what it is. */
  confidence: number;
  /** Metres of one unit of the file's lengths; null where it is not known. */
  unit: number | null;
  /** Sentences about what was assumed. */
  notes: string[];
  figure: Figure;
  /** The rotation that turned the file's world upright. */
  turn: Quaternion;
}

/** Retarget a motion of a human figure to the humanoid. MotionError, with the reason, for what is no human's. */
export function toHumanoid(motion: Motion, joints?: NamedJoints): Humanoid {
  const { skeleton } = checked(motion);
  const map = joints ? mapFrom(skeleton, joints) : mapOf(skeleton);
  const world = worldOf(motion);
  const fitted = fit(skeleton, map, world);
  checkFrames(fitted.body, world.places, hingesOf(fitted, world));
  const unit = unitOf(skeleton, fitted.leg);
  const { turn, note } = upright(fitted, world.places);
  const folded = map.joints.hips ? `the joint ${skeleton.names[0]} above the hips is folded in` : undefined;
  return {
    motion: retargeted(fitted, world, turn, motion),
    convention: map.convention,
    confidence: Math.round(100 * map.confidence * fitted.confidence) / 100,
    unit: unit.metres,
    notes: [...fitted.notes, unit.note, note, folded].filter((text) => text !== undefined),
    figure: { fitted, first: cut(motion, 0, 1) },
    turn,
  };
}

/** The motion on the humanoid; itself where it is the humanoid's. */
export function onHumanoid(motion: Motion): Motion {
  return isHumanoid(motion.skeleton) ? motion : toHumanoid(motion).motion;
}

/** Knees bend about the axis of the thigh. */
function hingesOf({ body, aligned }: Fitted, { turns }: World): Record<string, Vector[]> {
  return Object.fromEntries(
    SIDES.map((side) => {
      const joint = body.map.joints[`${side}UpperLeg`]!;
      const axis = rotated(aligned[joint]!, X);
      return [side, turns.map((turned) => rotated(turned[joint]!, axis))];
    }),
  );
}

function retargeted(fitted: Fitted, world: World, turn: Quaternion, { fps, travels }: Motion): Motion {
  const factor = LEG_LENGTH / fitted.leg;
  const turns = world.turns.map((frameTurns, frame) =>
    humanoidTurns(frameTurns, world.places[frame]!, fitted).map((local) => product(turn, local)),
  );
  const places = turns.map((turned, frame) => {
    const legs = times(rotated(turn, fitted.body.middle(world.places[frame]!, "UpperLeg")), factor);
    const placed = placesOf(HUMANOID, turned);
    const move = minus(legs, mean(HIPS.map((joint) => placed[joint]!)));
    return placed.map((place) => plus(place, move));
  });
  const ground = groundUnder(solePoints({ turns, places }));
  const root = places.map((pose) => minus(pose[0]!, [0, ground, 0]));
  return { ...motionFrom(HUMANOID, turns, new Map([[0, root]]), fps), travels };
}

/** Rotations in the world of the humanoid's joints, in one frame of a figure. */
function humanoidTurns(turns: Quaternion[], pose: Vector[], { body, aligned, pelvis }: Fitted): Quaternion[] {
  const { joints, spine, neck } = body.map;
  const alignedTurn = (joint: number) => product(turns[joint]!, aligned[joint]!);
  const rotations: Record<string, Quaternion> = {};
  for (const [bone, joint] of Object.entries(joints)) rotations[bone] = alignedTurn(joint);
  if (!pelvis) {
    const across = rotated(rotations.hips!, X);
    rotations.hips = product(swing(across, body.toLeft(pose, "UpperLeg")), rotations.hips!);
  }
  // back and neck share out the turns of as many joints as the figure has there
  const back = shared([rotations.hips!, ...spine.map(alignedTurn)], SPINE.length);
  SPINE.forEach((bone, at) => (rotations[bone] = back[at]!));
  const above = [...neck.map(alignedTurn), ...(rotations.head ? [rotations.head] : [])];
  if (above.length) {
    const upwards = shared([alignedTurn(spine.at(-1)!), ...above], NECK.length);
    NECK.forEach((bone, at) => (rotations[bone] = upwards[at]!));
  }
  // bones that the figure lacks go with their parents
  for (const bone of BONES.slice(1)) {
    rotations[bone] ??= rotations[HUMANOID.names[jointOf(bone).parent]!]!;
  }
  return HUMANOID.names.map(
    (name) =>
      rotations[name.endsWith(SKELETON.END_SUFFIX) ? name.slice(0, -SKELETON.END_SUFFIX.length) : name]!,
  );
}

/** Rotations of so many joints of another chain with the same ends, by how far up the chain each is; the first is no part. */
function shared(chain: Quaternion[], count: number): Quaternion[] {
  return Array.from({ length: count }, (_, at) => {
    const up = ((at + 1) * (chain.length - 1)) / count;
    const below = Math.ceil(up) - 1;
    return towards(chain[below]!, chain[below + 1]!, up - below);
  });
}

/** What a motion of the humanoid can be put onto: a figure, a motion of it, or its skeleton. */
export type Like = Figure | Motion | Skeleton;

/** The figure of a skeleton; of a motion where the rest pose is no standing body, as its frames then tell. */
export function figureOf(like: Like, joints?: NamedJoints): Figure {
  if ("fitted" in like) return like;
  const example = "rotations" in like ? checked(like) : atRest(like);
  const map: JointMap = joints ? mapFrom(example.skeleton, joints) : mapOf(example.skeleton);
  return { fitted: fit(example.skeleton, map, worldOf(example)), first: cut(example, 0, 1) };
}

/**
 * Retarget a motion of the humanoid to another human skeleton, whose fingers bend as in a relaxed hand; feet stay on
 * the ground. ahead: z becomes the way that the figure faces at rest. MotionError where one of them is no human's.
 */
export function fromHumanoid(
  motion: Motion,
  like: Like,
  { joints, ahead = false }: { joints?: NamedJoints; ahead?: boolean } = {},
): Motion {
  if (!isHumanoid(motion.skeleton))
    throw new MotionError("this motion is not on the humanoid: convert it with toHumanoid first");
  const figure = figureOf(like, joints);
  const { skeleton, still } = postureOf(figure);
  const { fitted } = figure;
  const world = worldOf(motion);
  const source = ahead ? facingAs(fitted, world) : world;

  // the figure's joints turn in the world as the humanoid's bones do
  const turned = source.turns.map((frameTurns) => figureTurns(frameTurns, fitted, skeleton, still));

  // its path is the humanoid's, scaled, and laid so that the feet are as high
  const carrier = carrierOf(fitted.body.map, skeleton);
  const moved = new Map([[carrier, moves(fitted, skeleton, source, turned, carrier)]]);
  return motionFrom(skeleton, turned, moved, motion.fps);
}

/** Frames of the humanoid turned so that z becomes the direction that a figure faces at rest. */
function facingAs(fitted: Fitted, world: World): World {
  const [x, , z] = rotated(fitted.aligned[fitted.body.map.joints.hips!]!, Z);
  if (Math.hypot(x, z) <= 0.5) return world; // at rest it faces up or down
  const front = about(Y, Math.atan2(x, z));
  return {
    turns: world.turns.map((turned) => turned.map((turn) => product(front, turn))),
    places: world.places.map((pose) => pose.map((place) => rotated(front, place))),
  };
}

/** The skeleton with its unit where that is known, and local rotations of joints that are no bones. */
function postureOf({ fitted, first }: Figure): { skeleton: Skeleton; still: Quaternion[] } {
  const inFrames = fitted.up === null;
  const { skeleton } = first;
  const still = inFrames ? first.rotations[0]! : skeleton.joints.map(() => STILL);
  const offset = (at: number) => (inFrames && at ? first.translations[0]![at]! : skeleton.joints[at]!.offset);
  const posed = skeleton.with(offset, skeleton.metresPerUnit ?? unitOf(skeleton, fitted.leg).metres);
  return { skeleton: posed, still: relaxed(posed, still, fitted.body.map.joints) };
}

/** Translations of a figure's carrier in its parent's frame: its path is scaled, its feet are as high over the ground. */
function moves(
  fitted: Fitted,
  skeleton: Skeleton,
  source: World,
  turned: Quaternion[][],
  carrier: number,
): Vector[] {
  const scale = fitted.leg / LEG_LENGTH;
  const figure = turned.map((turns) => placesOf(skeleton, turns));
  const moved = source.places.map((pose, at) =>
    minus(times(mean(HIPS.map((joint) => pose[joint]!)), scale), fitted.body.middle(figure[at]!, "UpperLeg")),
  );
  const soles = source.turns.map((turns, at) => {
    const pose = figure[at]!.map((place) => plus(place, moved[at]!));
    return solesOf(fitted, (bone) => turns[HUMANOID.index(bone)]!, pose);
  });
  const rise = scale * groundUnder(solePoints(source)) - groundUnder(soles);
  return moved.map((move, at): Vector => {
    const place: Vector = [move[0], move[1] + rise, move[2]];
    if (!carrier) return place;
    const above = skeleton.joints[carrier]!.parent;
    const apart = minus(plus(figure[at]![carrier]!, place), figure[at]![above]!);
    return rotated(inverse(turned[at]![above]!), minus(apart, skeleton.joints[0]!.offset));
  });
}

/** Rotations in the world of a figure's joints, from those of the humanoid's in one frame. */
function figureTurns(
  source: Quaternion[],
  { body, aligned }: Fitted,
  skeleton: Skeleton,
  still: Quaternion[],
): Quaternion[] {
  const { map } = body;
  const { joints, spine, neck } = map;
  const of = (bone: string) => source[HUMANOID.index(bone)]!;
  const wanted = new Map<number, Quaternion>();
  for (const [bone, joint] of Object.entries(joints)) wanted.set(joint, of(bone));
  shared(["hips", ...SPINE].map(of), spine.length).forEach((turn, at) => wanted.set(spine[at]!, turn));
  const above = shared([SPINE.at(-1)!, ...NECK].map(of), neck.length + (joints.head === undefined ? 0 : 1));
  neck.forEach((joint, at) => wanted.set(joint, above[at]!));
  const carrier = carrierOf(map, skeleton);
  if (!wanted.has(carrier)) wanted.set(carrier, wanted.get(joints.hips!)!);
  const hands = SIDES.map((side) => joints[`${side}Hand`]);
  const turned: Quaternion[] = [];
  const known = (at: number) => product(wanted.get(at)!, inverse(aligned[at]!));
  skeleton.joints.forEach(({ parent }, at) => {
    turned.push(wanted.has(at) ? known(at) : parent < 0 ? still[at]! : product(turned[parent]!, still[at]!));
    const hand = wanted.has(at) ? undefined : skeleton.children[at]!.find((child) => hands.includes(child));
    if (hand === undefined) return;
    // a joint between forearm and hand, as CMU's wrists, takes the hand's twist
    const toHand = product(inverse(turned[at]!), known(hand));
    turned[at] = product(turned[at]!, twist(toHand, skeleton.joints[hand]!.offset));
  });
  return turned;
}
