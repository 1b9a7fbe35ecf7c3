/* Acts, short motions of the humanoid that a steered figure can be told to do: docs/reference/bundle.md, "Acts". */
import { ACTS, type actSettings } from "../generated.js";
import type { Manifest } from "../bundle/bundle.js";
import { ControlError } from "../errors.js";
import { framesFor } from "../representation/frames.js";
import { contacts } from "../figures/feet/contacts.js";
import {
  BONES,
  groundUnder,
  HUMANOID,
  humanoidMotion,
  SIDES,
  solePoints,
} from "../figures/humanoid/bones.js";
import { type Motion, type World, worldOf } from "../motion/motion.js";
import { spread } from "../motion/numbers.js";
import { moved, type Pose as Ground } from "../motion/planar.js";
import {
  about,
  minus,
  normalised,
  product,
  type Quaternion,
  quaternionOf,
  rotated,
  rotationOf,
  size,
  STILL,
  turnAt,
  type Vector,
  Y,
} from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import { wrapped } from "../motion/springs.js";
import type { Played } from "./step.js";

/** A motion that a steered figure can play, a frame in each tick; `actOf` makes it. */
export interface Act {
  name: string;
  /** By frame, four numbers of each bone, in their order; the hips' in the frame of the facing. */
  rotations: Float64Array[];
  height: number[];
  ground: Ground[];
  contacts: [left: number, right: number][];
  /** Whether it is done by the legs: it bends them, jumps, raises a foot, or turns around. */
  legs: boolean;
  /** How it is in each frame: the features after those of the trajectory, not scaled. */
  features: number[][];
}

/** The rate of acts, and how slow what rests in them is: those of a `ControlModel`. */
export interface ActModel {
  readonly fps: number;
  readonly acts: Settings<typeof actSettings>;
}

/**
 * The act of frames, one after the other: of each, quaternions x, y, z, w of the 22 bones, the hips' in the frame of the
 * facing; x and z of the root in metres, its facing in radians; the hips' height in metres. What rests at both ends is left
 * out. ControlError for what is no act.
 */
export function actOf({ fps, acts: settings }: ActModel, name: string, numbers: ArrayLike<number>): Act {
  const values = Array.from(numbers);
  const frames = values.length / ACTS.WIDTH;
  if (!Number.isInteger(frames) || frames < ACTS.LEAST_ACT_FRAMES)
    throw new ControlError(
      `an act needs ${ACTS.LEAST_ACT_FRAMES} or more frames of ${ACTS.WIDTH} numbers, not ${values.length} numbers`,
    );
  if (!values.every((value) => Math.abs(value) <= ACTS.LARGEST_COORDINATE))
    throw new ControlError(`an act must be finite numbers, no larger than ${ACTS.LARGEST_COORDINATE}`);
  const rows = chunks(values, ACTS.WIDTH);
  const poses = rows.map((row): Played => ({
    ground: [row[ACTS.WIDTH - 4]!, row[ACTS.WIDTH - 3]!, row[ACTS.WIDTH - 2]!],
    rotations: Float64Array.from(
      BONES.flatMap((_, bone) => unitOf(row.slice(4 * bone, 4 * bone + 4) as Quaternion)),
    ),
    height: row[ACTS.WIDTH - 1]!,
    contacts: [1, 1],
  }));
  const world = worldOf(motionOf(poses, fps));
  const places = (at: number) => world.places[at]!.flat();
  const fast = rows.map(
    (_, at) =>
      Math.max(...chunks(rate(places, at, frames, fps), 3).map((speed) => size(speed as Vector))) >
      settings.rest,
  );
  const first = fast.indexOf(true);
  const last = fast.lastIndexOf(true);
  const within = <T>(all: T[]): T[] =>
    first >= 0 && last - first >= Math.round(settings.moves * fps) ? all.slice(first, last + 1) : all;
  const height = within(poses.map(({ height }) => height));
  const path = poses.map(({ ground }) => ground);
  const ground = within(path);
  const features = within(poseFeatures(world, path, fps));
  const contacts = within(footContacts(world, fps));
  const legs = byLegs(height, ground, features, settings);
  const rotations = within(poses.map(({ rotations }) => rotations));
  return { name, rotations, height, ground, contacts, legs, features };
}

function byLegs(
  height: number[],
  ground: Ground[],
  features: number[][],
  settings: Settings<typeof actSettings>,
): boolean {
  let facing = 0;
  const turned = ground.map(([, , to]) => (facing += wrapped(to - facing)));
  return (
    spread([ACTS.STANDING_HIPS, ...height]) > settings.bent ||
    Math.max(...features.map((feature) => Math.max(feature[1]!, feature[4]!))) > settings.raised ||
    spread(turned) > settings.turned
  );
}

/** Metres from where an act begins to where it ends. */
export function reachOf({ ground }: Act): number {
  const from = ground[0]!;
  const to = ground.at(-1)!;
  return Math.hypot(to[0] - from[0], to[1] - from[1]);
}

/** The frames of a motion of any human figure, as `actOf` takes them. */
export function numbersOf({ manifest, fps }: { manifest: Manifest; fps: number }, motion: Motion): number[] {
  let ground: Ground = [0, 0, 0];
  return framesFor(motion, manifest).flatMap((frame, at) => {
    const [forward, left, turn, height] = frame as [number, number, number, number];
    if (at) ground = moved(ground, [forward / fps, left / fps, turn / fps]);
    return [...BONES.flatMap((_, bone) => quaternionOf(rotationOf(frame, 4 + 6 * bone))), ...ground, height];
  });
}

function unitOf(quaternion: Quaternion): Quaternion {
  return Math.hypot(...quaternion) > 1e-6 ? normalised(quaternion) : quaternion;
}

function chunks(values: number[], width: number): number[][] {
  return Array.from({ length: values.length / width }, (_, at) => values.slice(at * width, (at + 1) * width));
}

/** Poses, a tick after each other, as a motion of the humanoid. */
export function motionOf(poses: Pick<Played, "ground" | "rotations" | "height">[], fps = 30): Motion {
  const rotations = poses.map((pose) => {
    const turns = HUMANOID.names.map((name): Quaternion => {
      const bone = BONES.indexOf(name);
      return bone < 0 ? STILL : turnAt(pose.rotations, bone);
    });
    turns[0] = product(about(Y, pose.ground[2]), turns[0]!);
    return turns;
  });
  const hips = poses.map(({ ground: [x, z], height }): Vector => [x, height, z]);
  return humanoidMotion(rotations, hips, fps);
}

/** How fast values change at a frame, a second: by those before and after it. */
function rate(values: (at: number) => number[], at: number, frames: number, fps: number): number[] {
  const from = Math.max(at - 1, 0);
  const to = Math.min(at + 1, frames - 1);
  const before = values(from);
  return values(to).map((value, i) => ((value - before[i]!) * fps) / (to - from));
}

/** Joints of which the features tell. */
const [TOES, HANDS] = ["Toes", "Hand"].map((part) => SIDES.map((side) => HUMANOID.index(side + part))) as [
  number[],
  number[],
];

function poseFeatures({ places }: World, way: Ground[], fps: number): number[][] {
  return places.map((now, at) => {
    const [x, z, facing] = way[at]!;
    const seen = (vector: Vector) => rotated(about(Y, -facing), vector);
    const place = (joint: number) => seen(minus(now[joint]!, [x, 0, z]));
    const speed = (joint: number) =>
      seen(rate((frame) => places[frame]![joint]!, at, places.length, fps) as Vector);
    return [...TOES.map(place), ...TOES.map(speed), speed(0), ...HANDS.map(place)].flat();
  });
}

function footContacts(world: World, fps: number): [number, number][] {
  const soles = solePoints(world);
  const ground = groundUnder(soles);
  const points = soles.map((frame) => frame.map(([x, y, z]): Vector => [x, y - ground, z]));
  const touch = contacts(points, fps).map((row): [number, number] => [
    Math.max(...row.slice(0, 3)),
    Math.max(...row.slice(3)),
  ]);
  return [touch[0]!, ...touch];
}

/** The move over the ground to a frame from the one before it, for a figure with a facing: x, z, turn. */
export function stepOf({ ground }: Act, frame: number, facing: number): Ground {
  const before = ground[frame - 1]!;
  const after = ground[frame]!;
  const [x, , z] = rotated(about(Y, facing - before[2]), [after[0] - before[0], 0, after[1] - before[1]]);
  return [x, z, after[2] - before[2]];
}
