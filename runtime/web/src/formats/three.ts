/* Motions for three.js, which is no dependency: plain objects that THREE.AnimationClip.parse takes. */
import { hexOf } from "../bundle/members.js";
import { SKELETON } from "../generated.js";
import { MotionError } from "../errors.js";
import { grounded, nearby } from "./glb.js";
import { BONES, HUMANOID } from "../figures/humanoid/bones.js";
import type { Motion } from "../motion/motion.js";
import { onHumanoid } from "../figures/humanoid/retarget.js";
import {
  inverse,
  minus,
  product,
  type Quaternion,
  rotated,
  times,
  type Vector,
} from "../motion/rotations.js";
import type { Skeleton } from "../motion/skeleton.js";

export interface Track {
  name: string;
  type: "quaternion" | "vector";
  times: number[];
  values: number[];
}

/** What THREE.AnimationClip.parse takes. */
export interface Clip {
  name: string;
  duration: number;
  tracks: Track[];
  uuid: string;
  blendMode: typeof NORMAL_BLENDING;
}

/** three's NormalAnimationBlendMode. */
const NORMAL_BLENDING = 2500;

/** What is needed of a VRM that @pixiv/three-vrm has loaded. */
export interface Avatar {
  meta: { metaVersion: string };
  humanoid: {
    getNormalizedBoneNode(bone: never): { name: string } | null;
    normalizedRestPose: Record<string, { position?: ArrayLike<number> } | undefined>;
  };
}

/**
 * A clip of a motion: of any human figure, for a VRM avatar; or else of the motion's own joints, by their names as three
 * writes them, which for a figure of readGLB are the nodes that GLTFLoader gives. MotionError for a figure that is no
 * human's, or an avatar without hips.
 */
export function toThree(motion: Motion, avatar?: Avatar): Clip {
  const tracks = avatar ? avatarTracks(grounded(onHumanoid(motion)), avatar) : jointTracks(motion);
  const duration = (motion.rotations.length - 1) / motion.fps;
  return { name: "motion", duration, tracks, uuid: uuid(), blendMode: NORMAL_BLENDING };
}

/** A random UUID, also on pages without TLS. */
function uuid(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  bytes[6] = (bytes[6]! & 0x0f) | 0x40;
  bytes[8] = (bytes[8]! & 0x3f) | 0x80;
  return hexOf(bytes).replace(/^(.{8})(.{4})(.{4})(.{4})/, "$1-$2-$3-$4-");
}

function jointTracks(motion: Motion): Track[] {
  const { skeleton, rotations, translations, fps } = motion;
  return skeleton.joints.flatMap(({ name, offset }, at) => {
    const node = (skeleton.nodes?.[at]?.name ?? name).replace(/\s/g, "_").replace(/[[\].:/]/g, "");
    const moving = at === 0 || translations.some((row) => row[at] !== offset);
    const turns = () => nearby(rotations.map((row) => turned(skeleton, at, row[at]!)));
    const turn = name.endsWith(SKELETON.END_SUFFIX)
      ? []
      : [track(`${node}.quaternion`, "quaternion", fps, turns())];
    const moves = () => translations.map((row) => placed(skeleton, at, row[at]!));
    return moving ? [...turn, track(`${node}.position`, "vector", fps, moves())] : turn;
  });
}

/** A joint's rotation as that of its node, in the frame of what it hangs below. */
function turned({ nodes }: Skeleton, at: number, turn: Quaternion): Quaternion {
  const node = nodes?.[at];
  return node ? product(product(inverse(node.above.turn), turn), node.turn) : turn;
}

function placed({ nodes, joints }: Skeleton, at: number, move: Vector): Vector {
  const above = nodes?.[at]?.above;
  if (!above) return move;
  return times(
    rotated(inverse(above.turn), joints[at]!.parent < 0 ? minus(move, above.place) : move),
    1 / above.scale,
  );
}

function avatarTracks({ fps, rotations, translations }: Motion, { humanoid, meta }: Avatar): Track[] {
  // a VRM of version 0 faces -z
  const sign = meta.metaVersion === "0" ? -1 : 1;
  const node = (bone: string) => humanoid.getNormalizedBoneNode(bone as never)?.name;
  const hips = node("hips");
  const height = humanoid.normalizedRestPose.hips?.position?.[1];
  if (hips === undefined || height === undefined)
    throw new MotionError("this avatar has no hips: a VRM humanoid is needed");
  const tracks = BONES.flatMap((bone) => {
    const name = node(bone);
    const at = HUMANOID.index(bone);
    const turns = rotations.map((row): Quaternion => [
      sign * row[at]![0],
      row[at]![1],
      sign * row[at]![2],
      row[at]![3],
    ]);
    return name === undefined ? [] : [track(`${name}.quaternion`, "quaternion", fps, nearby(turns))];
  });
  const scale = height / HUMANOID.joints[0]!.offset[1];
  const moves = translations.map((row): Vector => [
    sign * scale * row[0]![0],
    scale * row[0]![1],
    sign * scale * row[0]![2],
  ]);
  return [...tracks, track(`${hips}.position`, "vector", fps, moves)];
}

function track(name: string, type: Track["type"], fps: number, rows: number[][]): Track {
  return { name, type, times: rows.map((_, at) => at / fps), values: rows.flat() };
}
