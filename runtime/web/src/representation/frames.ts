/* Motions as the frames of a model, and back: docs/reference/bundle.md, "Frames". */
import type { Manifest } from "../bundle/bundle.js";
import { DecodingError, MotionError } from "../errors.js";
import { RETARGETING, ROOT_SIXD } from "../generated.js";
import { eulersOf, fromEuler } from "../motion/euler.js";
import { holdFeet } from "../figures/feet/hold.js";
import { BONES, HUMANOID, humanoidMotion, isHumanoid, jointOf } from "../figures/humanoid/bones.js";
import { unitOf } from "../figures/humanoid/measure.js";
import { Body } from "../figures/humanoid/body.js";
import { mapOf } from "../figures/humanoid/jointMap.js";
import type { Frames } from "../models/base.js";
import { checked, type Motion, resampled } from "../motion/motion.js";
import { rounded } from "../motion/numbers.js";
import { moved, type Pose as Ground, seenFrom } from "../motion/planar.js";
import { posesOf } from "./poses.js";
import {
  about,
  dot,
  minus,
  nearestTurn,
  ofVector,
  product,
  type Quaternion,
  RADIANS,
  rotated,
  size,
  times,
  type Vector,
  vectorOf,
  X,
  Y,
} from "../motion/rotations.js";
import { toHumanoid } from "../figures/humanoid/retarget.js";
import { Skeleton } from "../motion/skeleton.js";
import { travelling } from "../figures/feet/treadmill.js";

const KINDS: Record<string, string> = { root_angles: "r", root_vectors: "e", root_sixd: "x" };

/**
 * The frames of `describe`, `search`, `predict` or `generate` of a motion of any human figure; those of `predict` end
 * with it. A clip in place gets the path that its feet imply, but for `generate`.
 */
export function framesFor(motion: Motion, manifest: Manifest): number[][] {
  const { representation, fps } = manifest.motion;
  const bones = bonesOf(manifest);
  const prepared = manifest.verb !== "predict" && motion.fps === fps && isHumanoid(motion.skeleton);
  const whole = manifest.verb === "generate" || prepared ? checked(motion) : travelling(checked(motion));
  const kept = manifest.loop === "free_run" ? resampled(whole, fps, true) : whole;
  const figure = resampled(onFigure(kept, fps), fps);
  const metres = figure.skeleton.metresPerUnit!;
  const places = figure.translations.map((moves) => times(moves[0]!, metres));
  const turns = (bone: string) => figure.rotations.map((row) => row[figure.skeleton.index(bone)]!);
  const root = figure.rotations.map((row) => row[0]!);
  if (representation === "root_sixd") return sixd(root, places, bones.slice(1).map(turns), fps);
  const block = eulersOf(root, "yxz");
  const unit = representation === "root_angles" ? RADIANS : 1;
  const joints = bones.map((bone) =>
    representation === "root_angles" ? degrees(turns(bone), bone) : vectors(turns(bone)),
  );
  const headings = block.map(([heading]) => heading);
  const rates = velocities(places, headings, fps);
  return rates.map(([forward, left, turn], at) => {
    const [, pitch, roll] = block[at]!;
    return [
      forward,
      left,
      turn / unit,
      places[at]![1],
      pitch / unit,
      roll / unit,
      ...joints.flatMap((joint) => joint[at]!),
    ];
  });
}

/** The bones that the channels of a model on the humanoid speak of; DecodingError for any other model. */
function bonesOf({ motion: { representation, channels, skeleton } }: Manifest): string[] {
  const kind = KINDS[representation];
  const bones = channels
    .filter((name) => name.endsWith(kind === "x" ? ".xx" : `.${kind}x`))
    .map((name) => name.slice(0, -3));
  const whole = channels.length === (kind === "x" ? 4 + 6 * bones.length : 6 + 3 * bones.length);
  const local =
    skeleton?.joints.length === HUMANOID.joints.length &&
    skeleton.joints.every(({ name }, at) => name === HUMANOID.names[at]);
  if (!kind || !whole || !local)
    throw new DecodingError(
      `motions are made into frames of models on the humanoid, not of ${representation}`,
    );
  return bones;
}

/** The motion on the humanoid or, where its joints are the humanoid's, as it is, in a known unit. */
function onFigure(motion: Motion, fps: number): Motion {
  const { skeleton } = motion;
  if (isHumanoid(skeleton)) return motion;
  if (!hasBones(skeleton)) {
    if (!motion.travels)
      throw new MotionError(
        "this motion lacks the path of the figure: it has no channels for the root's place",
      );
    return toHumanoid(motion.fps > fps ? resampled(motion, fps) : motion).motion;
  }
  const unit =
    skeleton.metresPerUnit ??
    unitOf(skeleton, new Body(skeleton, mapOf(skeleton)).legLength(skeleton.rest)).metres;
  if (unit === null) throw new MotionError("the unit of lengths is not known");
  return { ...motion, skeleton: new Skeleton(skeleton.joints, unit) };
}

/** Whether a skeleton has all bones by the humanoid's names, which point within 45 degrees of the humanoid's. */
function hasBones(skeleton: Skeleton): boolean {
  const at = (figure: Skeleton, name: string) => figure.rest[figure.names.indexOf(name)]!;
  return (
    BONES.every((name) => skeleton.names.includes(name)) &&
    HUMANOID.joints.every(({ name, parent }) => {
      if (parent < 0 || !skeleton.names.includes(name)) return true;
      const above = HUMANOID.names[parent]!;
      const [bone, other] = [skeleton, HUMANOID].map((figure) =>
        minus(at(figure, name), at(figure, above)),
      ) as [Vector, Vector];
      return (
        Math.min(size(bone), size(other)) < RETARGETING.SHORTEST_BONE ||
        dot(bone, other) >= Math.cos(RETARGETING.FARTHEST_BONES * RADIANS) * size(bone) * size(other)
      );
    })
  );
}

function degrees(turns: Quaternion[], bone: string): number[][] {
  const { order } = jointOf(bone);
  return eulersOf(turns, order).map((angles) =>
    Array.from("xyz", (axis) => angles[order.indexOf(axis)]! / RADIANS),
  );
}

/** Rotation vectors that do not leap: from the last frame backwards each is the one nearest to that after it. */
function vectors(turns: Quaternion[]): number[][] {
  const unwrapped = turns.map(vectorOf);
  for (let at = unwrapped.length - 2; at >= 0; at--) {
    unwrapped[at] = nearestTurn(unwrapped[at]!, unwrapped[at + 1]!);
  }
  return unwrapped;
}

/** Forward and to the left in metres and the turn, a second; the first frame has the second one's. */
function velocities(places: Vector[], facing: number[], fps: number): Ground[] {
  if (places.length < 2) return [[0, 0, 0]];
  return places.map((_, at) => {
    const later = Math.max(at, 1);
    const [from, to] = [later - 1, later].map((time): Ground => [
      places[time]![0],
      places[time]![2],
      facing[time]!,
    ]) as [Ground, Ground];
    return seenFrom(from, to).map((rate) => rate * fps) as Ground;
  });
}

function sixd(root: Quaternion[], places: Vector[], joints: Quaternion[][], fps: number): number[][] {
  const facing = facingOf(root, fps);
  const axes = (turn: Quaternion) => [...rotated(turn, X), ...rotated(turn, Y)];
  return velocities(places, facing, fps).map((rates, at) => {
    const hips = product(about(Y, -facing[at]!), root[at]!);
    return [...rates, places[at]![1], ...axes(hips), ...joints.flatMap((turns) => axes(turns[at]!))];
  });
}

/** The turn about the vertical axis, smoothed over time, calm where the root is tilted: docs/reference/bundle.md, "Frames". */
function facingOf(root: Quaternion[], fps: number): number[] {
  const deviation = ROOT_SIXD.FACING_SPREAD * fps;
  const reach = Math.max(1, rounded(4 * deviation));
  const doubled = root.map(([, y, , w]) => [w * w - y * y, 2 * w * y] as const);
  let last = 0;
  return root.map((_, at) => {
    let real = 0;
    let imaginary = 0;
    for (let step = Math.max(-reach, -at); step <= reach && at + step < root.length; step++) {
      const weight = Math.exp(-0.5 * (step / deviation) ** 2);
      real += weight * doubled[at + step]![0];
      imaginary += weight * doubled[at + step]![1];
    }
    const angle = Math.atan2(imaginary, real);
    last = at ? angle - 2 * Math.PI * Math.round((angle - last) / (2 * Math.PI)) : angle;
    return last;
  });
}

/** A motion of the humanoid from a model's frames, from the origin, facing z; feet of `root_sixd` are held unless `plant` is false. */
export function motionOf(
  frames: Frames,
  manifest: Manifest,
  { plant = true }: { plant?: boolean } = {},
): Motion {
  const { representation, fps } = manifest.motion;
  const bones = bonesOf(manifest);
  if (!frames.length) throw new DecodingError("there are no frames to make a motion of");
  if (representation === "root_sixd") return ofSixd(plant ? plantFeet(frames, manifest) : frames, manifest);
  const unit = representation === "root_angles" ? RADIANS : 1;
  let ground: Ground = [0, 0, 0];
  const rows = frames.map((frame, at) => {
    const [forward, left, turn] = [frame[0]!, frame[1]!, frame[2]!];
    const [height, pitch, roll] = [frame[3]!, frame[4]!, frame[5]!];
    if (at) ground = moved(ground, [forward / fps, left / fps, (turn * unit) / fps]);
    const rotations: Record<string, Quaternion> = {
      hips: fromEuler([ground[2], pitch * unit, roll * unit], "yxz"),
    };
    bones.forEach((bone, i) => {
      const values = [0, 1, 2].map((axis) => frame[6 + 3 * i + axis]! * unit) as Vector;
      rotations[bone] = turnOf(values, bone, unit === 1);
    });
    return { hips: [ground[0], height, ground[1]] as Vector, rotations };
  });
  return posed(rows, fps);
}

function turnOf(values: Vector, bone: string, isVector: boolean): Quaternion {
  const { order } = jointOf(bone);
  return isVector
    ? ofVector(values)
    : fromEuler(Array.from(order, (axis) => values["xyz".indexOf(axis)]!) as Vector, order);
}

/** Frames of `root_sixd` with standing feet held in place: what Python gives for a sentence. */
export function plantFeet(frames: Frames, manifest: Manifest): Frames {
  const held = frames.length < 2 ? undefined : holdFeet(ofSixd(frames, manifest));
  return held ? framesFor(held, manifest) : frames;
}

function ofSixd(frames: Frames, manifest: Manifest): Motion {
  return posed(posesOf(frames, manifest), manifest.motion.fps);
}

function posed(poses: { hips: Vector; rotations: Record<string, Quaternion> }[], fps: number): Motion {
  const rotations = poses.map((pose) =>
    HUMANOID.names.map((name): Quaternion => pose.rotations[name] ?? [0, 0, 0, 1]),
  );
  const hips = poses.map((pose) => pose.hips);
  return checked(humanoidMotion(rotations, hips, fps));
}
