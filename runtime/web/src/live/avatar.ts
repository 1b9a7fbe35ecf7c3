/* Avatars: the mesh of a .vrm or .glb file, and its joints in the poses of the humanoid. */
import { FormatError, MotionError } from "../errors.js";
import { Gltf, inlined, mapped, type Material, type MeshPart, type Placed } from "../formats/gltfData.js";
import { restOf } from "../formats/gltf.js";
import { LEG_LENGTH } from "../figures/humanoid/bones.js";
import { worldOf } from "../motion/motion.js";
import { type Figure as Measured, figureOf, fromHumanoid } from "../figures/humanoid/retarget.js";
import { AXES, minus, plus, rotated, times, type Vector } from "../motion/rotations.js";
import { motionOf, type Shown } from "./figure.js";
import type { Mesh, Primitive } from "./stage.js";

const VERTICES = 400_000;
const TRIANGLES = 4;

/** What of a file is drawn, and how its joints follow a pose. */
export class Avatar {
  /** Metres of the humanoid for one of the avatar's: its legs get the humanoid's length, so its feet stay where they stand. */
  readonly scale: number;

  private constructor(
    readonly mesh: Mesh,
    private readonly rest: Vector[],
    /** Of each slot of the mesh the joint that moves it. */
    private readonly movers: number[],
    private readonly measured: Measured,
  ) {
    this.scale = LEG_LENGTH / measured.fitted.leg;
  }

  /** FormatError or MotionError for a file that has no figure, no mesh, or is no human's. */
  static async read(content: Uint8Array): Promise<Avatar> {
    const gltf = Gltf.parse(content);
    checkHumanoid(gltf);
    const { skeleton, joints, rest } = restOf(gltf);
    const slots = new Slots(gltf, joints, rest);
    const primitives = await primitivesOf(gltf, slots);
    if (!primitives.length) throw new FormatError("it has a skeleton but no mesh that could be shown");
    const mesh = { primitives, inverseBind: Float32Array.from(slots.binds.flat()) };
    return new Avatar(
      mesh,
      skeleton.rest.map((place) => plus(place, skeleton.joints[0]!.offset)),
      slots.movers,
      figureOf(skeleton),
    );
  }

  /** Of a pose a matrix for each slot of the mesh, columns first, from where it is at rest; and where the humanoid's joints are. */
  posed(shown: Shown): { matrices: Float32Array; places: Vector[] } {
    const { turns, places } = worldOf(fromHumanoid(motionOf([shown]), this.measured));
    const matrices = new Float32Array(16 * this.movers.length);
    this.movers.forEach((joint, slot) => {
      const turn = turns[0]![joint]!;
      const axes = AXES.map((axis) => rotated(turn, axis));
      const move = minus(places[0]![joint]!, rotated(turn, this.rest[joint]!));
      matrices.set(columns(axes, move), 16 * slot);
    });
    return { matrices, places: shown.places.map((place) => times(place, 1 / this.scale)) };
  }
}

/** A VRM file has to say which node is which bone. */
function checkHumanoid(gltf: Gltf): void {
  const { VRM, VRMC_vrm } = gltf.document.extensions ?? {};
  if ((VRM || VRMC_vrm) && !gltf.humanoid().size)
    throw new MotionError("this VRM file has no humanoid: assign its bones and export it again");
}

function columns(axes: Vector[], [x, y, z]: Vector): number[] {
  return [...axes.flatMap((axis) => [...axis, 0]), x, y, z, 1];
}

/** The matrices that a mesh hangs on: joints of skins, and nodes whose meshes have none. */
class Slots {
  readonly binds: number[][] = [];
  readonly movers: number[] = [];
  private readonly skins = new Map<number, number>();

  constructor(
    private readonly gltf: Gltf,
    private readonly joints: number[],
    private readonly rest: Map<number, Placed>,
  ) {}

  /** The first slot of a skin. */
  ofSkin(skin: number): number {
    const known = this.skins.get(skin);
    if (known !== undefined) return known;
    const start = this.binds.length;
    const { joints, inverseBindMatrices } = this.gltf.document.skins![skin]!;
    const inverse = inverseBindMatrices === undefined ? null : this.gltf.array(inverseBindMatrices);
    joints.forEach((node, at) => this.add(node, inverse?.[at]));
    this.skins.set(skin, start);
    return start;
  }

  /** A slot of a node: its place at rest, after the matrix that brings a vertex to it. */
  add(node: number, bind?: readonly number[]): number {
    const { linear, place } = this.rest.get(node)!;
    const column = (at: number) =>
      bind ? (bind.slice(at, at + 3) as Vector) : (AXES[at / 4] ?? ([0, 0, 0] as Vector));
    const axes = [0, 4, 8].map((at) => mapped(linear, column(at)));
    this.binds.push(columns(axes, plus(place, mapped(linear, column(12)))));
    let above = node;
    while (above >= 0 && !this.joints.includes(above)) above = this.gltf.parents[above]!;
    this.movers.push(Math.max(0, this.joints.indexOf(above)));
    return this.binds.length - 1;
  }
}

type Images = Map<number, Promise<ImageBitmap | null>>;

async function primitivesOf(gltf: Gltf, slots: Slots): Promise<Primitive[]> {
  const rows = new Map<number, number[][]>(); // parts of a mesh share their vertices
  const array = (at: number) => rows.get(at) ?? rows.set(at, gltf.array(at)).get(at)!;
  const images: Images = new Map();
  const primitives: Promise<Primitive>[] = [];
  gltf.nodes.forEach(({ mesh, skin }, node) => {
    if (mesh === undefined || !gltf.order.includes(node)) return;
    const slot = skin === undefined ? slots.add(node) : slots.ofSkin(skin);
    const parts = gltf.document.meshes![mesh]!.primitives.filter(
      (part) => (part.mode ?? TRIANGLES) === TRIANGLES,
    );
    for (const part of parts)
      primitives.push(primitiveOf(gltf, part, array, slot, skin !== undefined, images));
  });
  return Promise.all(primitives);
}

async function primitiveOf(
  gltf: Gltf,
  part: MeshPart,
  array: (at: number) => number[][],
  slot: number,
  skinned: boolean,
  images: Images,
): Promise<Primitive> {
  const { POSITION, NORMAL, TEXCOORD_0, JOINTS_0, WEIGHTS_0 } = part.attributes;
  if (POSITION === undefined || (part.extensions && "KHR_draco_mesh_compression" in part.extensions)) {
    throw new FormatError("its mesh is compressed by Draco: export it without");
  }
  const vertices = array(POSITION);
  if (vertices.length > VERTICES)
    throw new FormatError(`a mesh of ${vertices.length} vertices is too large: at most ${VERTICES}`);
  const flat = (at: number | undefined) => (at === undefined ? null : Float32Array.from(array(at).flat()));
  const hangs = skinned && JOINTS_0 !== undefined && WEIGHTS_0 !== undefined;
  const material = gltf.document.materials?.[part.material ?? -1];
  const base = material?.pbrMetallicRoughness;
  return {
    positions: Float32Array.from(vertices.flat()),
    normals: flat(NORMAL),
    uvs: flat(TEXCOORD_0),
    joints: Uint16Array.from(
      hangs
        ? array(JOINTS_0)
            .flat()
            .map((joint) => joint + slot)
        : vertices.flatMap(() => [slot, 0, 0, 0]),
    ),
    weights: Float32Array.from(hangs ? array(WEIGHTS_0).flat() : vertices.flatMap(() => [1, 0, 0, 0])),
    indices: Uint32Array.from(part.indices === undefined ? vertices.keys() : array(part.indices).flat()),
    colour: base?.baseColorFactor ?? [1, 1, 1, 1],
    image: await imageOf(gltf, base?.baseColorTexture?.index, images),
    cut: cutOf(material),
    twoSided: material?.doubleSided ?? false,
  };
}

/** The opacity below which a pixel is not drawn. */
function cutOf(material?: Material): number {
  if (material?.alphaMode === "MASK") return material.alphaCutoff ?? 0.5;
  return material?.alphaMode === "BLEND" ? 0.3 : 0;
}

/** The picture of a texture; null where there is none in the file that a browser reads. */
function imageOf(gltf: Gltf, texture: number | undefined, images: Images): Promise<ImageBitmap | null> {
  const { document } = gltf;
  const source = document.textures?.[texture ?? -1]?.source;
  const { bufferView, uri, mimeType: type = "image/png" } = document.images?.[source ?? -1] ?? {};
  if (source === undefined || (bufferView === undefined && !uri?.startsWith("data:")))
    return Promise.resolve(null);
  const content = bufferView === undefined ? inlined(uri!) : gltf.bytes(bufferView);
  const read = () => createImageBitmap(new Blob([content as BlobPart], { type })).catch(() => null);
  return images.get(source) ?? images.set(source, read()).get(source)!;
}
