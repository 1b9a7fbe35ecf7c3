/* Files that are dropped on the page: a motion that the figure does, or an avatar that it becomes. */
import { readBVH } from "../formats/bvh.js";
import { FormatError, MotionError } from "../errors.js";
import { Gltf } from "../formats/gltfData.js";
import { clipsOf, readGLB } from "../formats/gltf.js";
import { isHumanoid } from "../figures/humanoid/bones.js";
import { cut, type Motion, resampled } from "../motion/motion.js";
import { toHumanoid } from "../figures/humanoid/retarget.js";
import { RADIANS } from "../motion/rotations.js";
import { wrapped } from "../motion/springs.js";
import { Avatar } from "./avatar.js";

const LARGEST = 200e6;
const MOST_SECONDS = 60;

/** What is in a file; told: a sentence about it. The motion is of the humanoid, at the page's rate. */
export interface Dropped {
  text: string;
  motion?: Motion;
  avatar?: Avatar;
}

/** Read a dropped file; a sentence with its name is thrown as an Error where it is neither a motion nor an avatar. */
export async function dropped(file: File, fps: number): Promise<Dropped> {
  try {
    if (file.size > LARGEST)
      throw new FormatError(
        `it has ${Math.round(file.size / 1e6)} MB, and at most ${LARGEST / 1e6} are read`,
      );
    return await opened(file.name, new Uint8Array(await file.arrayBuffer()), fps);
  } catch (error) {
    if (!(error instanceof FormatError || error instanceof MotionError)) throw error;
    const why = error.message.replace(
      /[:;] give a map of bones and joints$/,
      ", and only human figures move here",
    );
    throw new Error(`${file.name} cannot be used: ${why}`, { cause: error });
  }
}

async function opened(name: string, content: Uint8Array, fps: number): Promise<Dropped> {
  const start = new TextDecoder().decode(content.subarray(0, 200)).trimStart();
  if (/^\ufeff?HIERARCHY/i.test(start)) return played(name, readBVH(content), fps);
  if (!start.startsWith("glTF") && !start.startsWith("{")) {
    throw new FormatError("it is neither a motion (.bvh, .glb, .vrma) nor an avatar (.vrm, .glb)");
  }
  const { document } = Gltf.parse(content);
  const moves = document.animations?.length ? clipsOf(content).length > 0 : false;
  if (!document.meshes?.length || document.extensions?.VRMC_vrm_animation)
    return played(name, readGLB(content), fps);
  const avatar = await Avatar.read(content);
  const text = `${name} is who moves now.`;
  if (!moves) return { avatar, text };
  const motion = played(name, readGLB(content), fps);
  return { avatar, ...motion, text: `${text} ${motion.text}` };
}

function played(name: string, source: Motion, fps: number): Dropped {
  const { length } = source.rotations;
  const rate = source.fps;
  if (length < 3) throw new MotionError("it has a figure but no motion");
  const humanoid = isHumanoid(source.skeleton);
  const first = cut(source, 0, MOST_SECONDS * rate);
  const result = humanoid
    ? { motion: first, convention: "motet's humanoid", notes: [] }
    : toHumanoid(rate > fps ? resampled(first, fps) : first);
  const motion = resampled(result.motion, fps);
  const figure = `${source.skeleton.joints.length} joints${humanoid || result.convention ? `, ${result.convention}` : ""}`;
  const shown = length > first.rotations.length ? `, of which the first ${MOST_SECONDS} s are shown` : "";
  const text = `${name}: a figure of ${figure}; ${(length / rate).toFixed(1)} s at ${Math.round(rate)} frames a second${shown}. ${way(motion)}`;
  return { motion, text };
}

/** How far a motion of the humanoid goes and how it turns, in words. */
export function way({ translations, rotations, fps }: Motion): string {
  const places = translations.map((moves) => moves[0]!);
  const half = Math.round(fps / 2); // twice a second, so that swaying hips go nowhere
  const stops = places.filter((_, at) => at % half === 0);
  const gone = stops
    .slice(1)
    .reduce((sum, [x, , z], at) => sum + Math.hypot(x - stops[at]![0], z - stops[at]![2]), 0);
  const facings = rotations.map(([hips]) =>
    Math.atan2(2 * (hips![0] * hips![2] + hips![1] * hips![3]), 1 - 2 * (hips![0] ** 2 + hips![1] ** 2)),
  );
  const turned =
    facings.slice(1).reduce((sum, facing, at) => sum + wrapped(facing - facings[at]!), 0) / RADIANS;
  const seconds = places.length / fps;
  const goes =
    gone < 0.5 ? "It stays in its place" : `It goes ${gone.toFixed(1)} m, ${(gone / seconds).toFixed(1)} m/s`;
  const turns =
    Math.abs(turned) < 30
      ? ""
      : `, and turns ${Math.round(Math.abs(turned))} degrees to the ${turned > 0 ? "left" : "right"}`;
  return `${goes}${turns}.`;
}
