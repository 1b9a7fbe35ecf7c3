/* Writing GLB files whose nodes are the humanoid in a T-pose: VRM Animation, docs/reference/formats.md, and motions with a body. */
import { joined } from "../bundle/members.js";
import { SKELETON } from "../generated.js";
import { MotionError } from "../errors.js";
import { relaxed } from "../figures/humanoid/fingers.js";
import { BONES, FINGERED, groundUnder, HUMANOID, solePoints } from "../figures/humanoid/bones.js";
import { checked, type Motion, worldOf } from "../motion/motion.js";
import { minus, plus, type Quaternion, STILL } from "../motion/rotations.js";
import type { Skeleton } from "../motion/skeleton.js";
import { onHumanoid } from "../figures/humanoid/retarget.js";

type Numbers = Float32Array | Uint32Array | Uint16Array;

/** A surface that joints of the humanoid carry: of each corner its place in metres, normal, and four joints with weights. Parts have colours, linear. */
export interface Surface {
  positions: number[][];
  normals: number[][];
  joints: number[][];
  weights: number[][];
  parts: { colour: number[]; triangles: Uint32Array }[];
}

class Buffer {
  private readonly parts: Numbers[] = [];
  length = 0;
  readonly bufferViews: object[] = [];
  readonly accessors: object[] = [];

  /** The index of a new accessor of rows of numbers. */
  add(rows: number[][], bounded = false): number {
    const data = Float32Array.from(rows.flat());
    if (!data.every(Number.isFinite))
      throw new MotionError("values of this motion exceed glTF's 32-bit numbers");
    const of = (end: (...values: number[]) => number) =>
      rows[0]!.map((_, at) => Math.fround(rows.map((row) => row[at]!).reduce((a, b) => end(a, b))));
    return this.put(data, rows[0]!.length, bounded ? { min: of(Math.min), max: of(Math.max) } : {});
  }

  /** The same of numbers in rows of a width; the length of all of them in bytes is a multiple of four. */
  put(data: Numbers, width: number, more: object = {}): number {
    this.bufferViews.push({ buffer: 0, byteOffset: this.length, byteLength: data.byteLength });
    const componentType = data instanceof Float32Array ? 5126 : data instanceof Uint32Array ? 5125 : 5123;
    const type = { 1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4" }[width];
    this.accessors.push({
      bufferView: this.bufferViews.length - 1,
      componentType,
      count: data.length / width,
      type,
      ...more,
    });
    this.parts.push(data);
    this.length += data.byteLength;
    return this.accessors.length - 1;
  }

  bytes(): Uint8Array {
    return joined(this.parts.map(({ buffer }) => new Uint8Array(buffer)));
  }
}

/** The bytes of a .vrma file of a motion, which is brought to the humanoid; a VRM avatar of any proportions plays it. */
export function toVRMA(motion: Motion): Uint8Array {
  const names = [...BONES, ...FINGERED.names.slice(HUMANOID.names.length)];
  const humanBones = Object.fromEntries(names.map((name) => [name, { node: FINGERED.index(name) }]));
  return fileOf(motion, new Buffer(), {
    extensionsUsed: ["VRMC_vrm_animation"],
    extensions: { VRMC_vrm_animation: { specVersion: "1.0", humanoid: { humanBones } } },
  });
}

/** The bytes of a .glb file of a motion, which is brought to the humanoid, and of a surface that moves with it. */
export function toGLB(motion: Motion, { positions, normals, joints, weights, parts }: Surface): Uint8Array {
  const buffer = new Buffer();
  const attributes = {
    POSITION: buffer.add(positions, true),
    NORMAL: buffer.add(normals),
    JOINTS_0: buffer.put(Uint16Array.from(joints.flat()), 4),
    WEIGHTS_0: buffer.add(weights),
  };
  const inverseBindMatrices = buffer.add(
    FINGERED.rest.map((place) => {
      const [x, y, z] = plus(place, FINGERED.joints[0]!.offset);
      return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -x, -y, -z, 1];
    }),
  );
  return fileOf(
    motion,
    buffer,
    {
      skins: [{ joints: FINGERED.names.map((_, at) => at), skeleton: 0, inverseBindMatrices }],
      meshes: [
        {
          name: "body",
          primitives: parts.map(({ triangles }, material) => ({
            attributes,
            indices: buffer.put(triangles, 1),
            material,
          })),
        },
      ],
      materials: parts.map(({ colour }) => ({
        pbrMetallicRoughness: { baseColorFactor: [...colour, 1], metallicFactor: 0, roughnessFactor: 0.8 },
      })),
    },
    [{ name: "body", mesh: 0, skin: 0 }],
  );
}

/** bodies: nodes beside the humanoid's. */
function fileOf(motion: Motion, buffer: Buffer, more: object, bodies: object[] = []): Uint8Array {
  const joints = nodesOf(FINGERED);
  const document = {
    asset: { version: "2.0", generator: "motet" },
    ...more,
    scene: 0,
    scenes: [{ nodes: [0, ...bodies.map((_, at) => joints.length + at)] }],
    nodes: [...joints, ...bodies],
    animations: [animation(buffer, grounded(onHumanoid(checked(motion))))],
    bufferViews: buffer.bufferViews,
    accessors: buffer.accessors,
    buffers: [{ byteLength: buffer.length }],
  };
  return container(document, buffer.bytes());
}

/** A motion of the humanoid laid on the ground where it is up to 0.1 m off it, as motions of models may be. */
export function grounded(motion: Motion): Motion {
  const ground = groundUnder(solePoints(worldOf(motion)));
  if (!(Math.abs(ground) < 0.1)) return motion;
  return {
    ...motion,
    translations: motion.translations.map(([root, ...rest]) => [minus(root!, [0, ground, 0]), ...rest]),
  };
}

function nodesOf({ joints, children }: Skeleton): object[] {
  return joints.map(({ name, offset }, at) => ({
    name,
    translation: offset,
    ...(children[at]!.length ? { children: children[at] } : {}),
  }));
}

function animation(buffer: Buffer, { fps, rotations, translations }: Motion): object {
  const frames = rotations.map((_, at) => [at / fps]);
  const times = buffer.add(frames, true);
  const start = buffer.add([[0]], true);
  const channels: object[] = [];
  const samplers: object[] = [];
  const track = (node: number, path: string, values: number[][]) => {
    channels.push({ sampler: samplers.length, target: { node, path } });
    samplers.push({
      input: values.length === rotations.length ? times : start,
      output: buffer.add(values),
      interpolation: "LINEAR",
    });
  };
  HUMANOID.names.forEach((name, at) => {
    if (!name.endsWith(SKELETON.END_SUFFIX))
      track(at, "rotation", nearby(rotations.map((turns) => turns[at]!)));
  });
  const path = translations.map((moves) => moves[0]!);
  track(0, "translation", path);
  const still = FINGERED.joints.map(() => STILL);
  const hands = relaxed(FINGERED, still, Object.fromEntries(FINGERED.names.map((name, at) => [name, at])));
  for (let at = HUMANOID.names.length; at < hands.length; at++) track(at, "rotation", [hands[at]!]);
  return { name: "motion", channels, samplers };
}

/** The same rotations with signs that keep each quaternion near the one before it. */
export function nearby(turns: Quaternion[]): Quaternion[] {
  let last = turns[0]!;
  return turns.map((turn) => {
    const cosine = turn.reduce((sum, value, at) => sum + value * last[at]!, 0);
    last = cosine < 0 ? (turn.map((value) => -value) as Quaternion) : turn;
    return last;
  });
}

/** A GLB file of a JSON object and the binary part, whose length is a multiple of four. */
function container(document: object, content: Uint8Array): Uint8Array {
  const json = new TextEncoder().encode(JSON.stringify(document));
  const padded = Math.ceil(json.length / 4) * 4;
  const file = new Uint8Array(28 + padded + content.length).fill(0x20, 20, 20 + padded);
  const view = new DataView(file.buffer);
  [0x46546c67, 2, file.length, padded, 0x4e4f534a].forEach((word, at) => view.setUint32(4 * at, word, true));
  view.setUint32(20 + padded, content.length, true);
  view.setUint32(24 + padded, 0x004e4942, true);
  file.set(json, 20);
  file.set(content, 28 + padded);
  return file;
}
