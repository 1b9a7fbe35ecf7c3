import type { Manifest } from "../bundle/bundle.js";
import { DecodingError } from "../errors.js";
import type { Frames } from "../models/base.js";
import { moved, type Pose as Ground, seenFrom } from "../motion/planar.js";
import {
  about,
  inverse,
  product,
  type Quaternion,
  quaternionOf,
  rotated,
  rotationOf,
  X,
  Y,
} from "../motion/rotations.js";
import { wrapped } from "../motion/springs.js";

/** The humanoid in one frame: its hips in metres, and each bone's rotation in its parent's frame, by VRM 1.0's names. */
export interface Pose {
  hips: [number, number, number];
  rotations: Record<string, Quaternion>;
}

const ROOT = ["root.forward", "root.left", "root.turn", "root.height"];

/** Poses of frames in `root_sixd` (docs/reference/bundle.md, Frames), from the origin, facing z; such as `generate` gives. */
export function posesOf(frames: Frames, manifest: Manifest): Pose[] {
  return poser(manifest)(frames);
}

/** Gives the poses of pieces of a motion as they come, such as those of `stream`: each goes on where the last one ended. */
export function poser({ motion: { representation, channels, fps } }: Manifest): (frames: Frames) => Pose[] {
  if (representation !== "root_sixd" || `${channels.slice(0, 4)}` !== `${ROOT}`) {
    throw new DecodingError(`poses are made of root_sixd, not of ${representation}`);
  }
  const bones = channels.filter((name) => name.endsWith(".xx")).map((name) => name.slice(0, -3));
  let ground: Ground | undefined;
  return (frames) =>
    frames.map((frame) => {
      ground = ground ? moved(ground, [frame[0]! / fps, frame[1]! / fps, frame[2]! / fps]) : [0, 0, 0];
      const rotations = Object.fromEntries(
        bones.map((bone, i) => [bone, quaternionOf(rotationOf(frame, ROOT.length + 6 * i))]),
      );
      const half = ground[2] / 2;
      rotations[bones[0]!] = product([0, Math.sin(half), 0, Math.cos(half)], rotations[bones[0]!]!);
      return { hips: [ground[0], frame[3]!, ground[1]], rotations };
    });
}

/** Frames in `root_sixd` of poses in turn that know where their figure is, such as a steered one's; the first stands still. */
export function framesOf(poses: (Pose & { ground: Ground })[], fps: number): number[][] {
  return poses.map(({ hips, rotations, ground }, at) => {
    const [forward, left, turn] = seenFrom(poses[Math.max(at - 1, 0)]!.ground, ground);
    const axes = Object.entries(rotations).flatMap(([bone, turned]) => {
      const local = bone === "hips" ? product(inverse(about(Y, ground[2])), turned) : turned;
      return [...rotated(local, X), ...rotated(local, Y)];
    });
    return [forward * fps, left * fps, wrapped(turn) * fps, hips[1], ...axes];
  });
}
