/* The parts of a glTF 2.0 file (.glb, .vrm, .vrma, .gltf): its JSON object, its nodes as trees, its arrays of numbers. */
import { bytesOf } from "../bundle/packing.js";
import { GLTF_DATA } from "../generated.js";
import { FormatError } from "../errors.js";
import {
  AXES,
  normalised,
  plus,
  product,
  type Quaternion,
  quaternionOf,
  rotated,
  times,
  type Vector,
} from "../motion/rotations.js";

export interface Node {
  name?: string;
  children?: number[];
  translation?: Vector;
  rotation?: Quaternion;
  scale?: Vector;
  matrix?: number[];
  mesh?: number;
  skin?: number;
  camera?: number;
}

/** A part of a mesh: accessors by what they hold. */
export interface MeshPart {
  attributes: Record<string, number>;
  indices?: number;
  material?: number;
  mode?: number;
  extensions?: object;
}

export interface Material {
  pbrMetallicRoughness?: { baseColorFactor?: number[]; baseColorTexture?: { index: number } };
  alphaMode?: string;
  alphaCutoff?: number;
  doubleSided?: boolean;
}

export interface Animation {
  name?: string;
  channels: { sampler: number; target: { node?: number; path: string } }[];
  samplers: { input: number; output: number; interpolation?: string }[];
}

export interface Document {
  asset: { version: string };
  nodes?: Node[];
  skins?: { joints: number[]; inverseBindMatrices?: number }[];
  meshes?: { primitives: MeshPart[] }[];
  materials?: Material[];
  textures?: { source?: number }[];
  images?: { bufferView?: number; uri?: string; mimeType?: string }[];
  animations?: Animation[];
  accessors?: {
    bufferView?: number;
    byteOffset?: number;
    componentType: number;
    count: number;
    type: string;
    normalized?: boolean;
    sparse?: Sparse;
  }[];
  bufferViews?: {
    buffer: number;
    byteOffset?: number;
    byteLength: number;
    byteStride?: number;
    extensions?: object;
  }[];
  buffers?: { byteLength: number; uri?: string }[];
  extensions?: Record<string, { humanoid?: { humanBones?: unknown } }>;
}

/** Where elements of an accessor are. */
interface Part {
  bufferView: number;
  byteOffset?: number;
}

/** Elements that replace those of an accessor, at rising indices. */
interface Sparse {
  count: number;
  indices: Part & { componentType: number };
  values: Part;
}

/** Where a node is in the world: its rotation without scale, its linear map as columns, and its place. */
export interface Placed {
  turn: Quaternion;
  linear: [Vector, Vector, Vector];
  place: Vector;
}

/** A node's translation, rotation and scale, those that are moved. */
export interface Local {
  translation?: Vector;
  rotation?: Quaternion;
  scale?: Vector;
}

const WIDTHS: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
const READERS: Record<number, [size: number, most: number, read: (view: DataView, at: number) => number]> = {
  5120: [1, 127, (view, at) => view.getInt8(at)],
  5121: [1, 255, (view, at) => view.getUint8(at)],
  5122: [2, 32767, (view, at) => view.getInt16(at, true)],
  5123: [2, 65535, (view, at) => view.getUint16(at, true)],
  5125: [4, 2 ** 32 - 1, (view, at) => view.getUint32(at, true)],
  5126: [4, 1, (view, at) => view.getFloat32(at, true)],
};

export class Gltf {
  readonly nodes: Node[];
  /** The parent of each node, -1 for a root. */
  readonly parents: number[];
  /** All nodes, parents first, branch by branch. */
  readonly order: number[] = [];
  private numbers = 0;

  private constructor(
    readonly document: Document,
    private readonly buffers: Uint8Array[],
  ) {
    this.nodes = document.nodes ?? [];
    if (this.nodes.length > GLTF_DATA.MAX_NODES)
      throw new FormatError(`it has ${this.nodes.length} nodes: expected at most ${GLTF_DATA.MAX_NODES}`);
    this.parents = this.nodes.map(() => -1);
    this.nodes.forEach(({ children = [] }, at) => {
      for (const child of children) {
        if (this.parents[child] !== -1 || child === at)
          throw new FormatError(`its nodes are not a tree: node ${child} below node ${at}`);
        this.parents[child] = at;
      }
    });
    const waiting = this.nodes
      .map((_, at) => at)
      .filter((at) => this.parents[at] === -1)
      .reverse();
    for (let node = waiting.pop(); node !== undefined; node = waiting.pop()) {
      this.order.push(node);
      waiting.push(...[...(this.nodes[node]!.children ?? [])].reverse());
    }
    if (this.order.length < this.nodes.length)
      throw new FormatError("its nodes are not a tree: some of them form a cycle");
  }

  /** Parse a file; FormatError where it is not glTF 2.0, is cut short, or needs other files. */
  static parse(content: Uint8Array): Gltf {
    const isBinary = content.length >= 12 && new TextDecoder().decode(content.subarray(0, 4)) === "glTF";
    const { json, binary } = isBinary ? chunks(content) : { json: content, binary: new Uint8Array() };
    let document: Document;
    try {
      document = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(json)) as Document;
    } catch {
      throw new FormatError("not a glTF file, or cut short: it has no JSON object");
    }
    const version = `${document?.asset?.version}`;
    if (!version.startsWith("2."))
      throw new FormatError(`not a file of glTF 2.0 (its version: ${version.slice(0, 20)})`);
    const buffers = (document.buffers ?? []).map(({ uri, byteLength }) => {
      if (uri === undefined) return binary.subarray(0, byteLength);
      if (!uri.startsWith("data:"))
        throw new FormatError(
          `its buffer ${JSON.stringify(uri.slice(0, 60))} is a file of its own: export one .glb`,
        );
      return inlined(uri).subarray(0, byteLength);
    });
    return new Gltf(document, buffers);
  }

  /** Bone -> node, by VRM 0, VRM 1 or VRM Animation; empty if none. */
  humanoid(): Map<string, number> {
    const { VRM, VRMC_vrm, VRMC_vrm_animation } = this.document.extensions ?? {};
    if (VRM) {
      const old = (VRM.humanoid?.humanBones ?? []) as { bone: string; node: number }[];
      return new Map(old.filter(({ node }) => node !== -1).map(({ bone, node }) => [bone, node])); // UniVRM's bones that are not set
    }
    const bones = (VRMC_vrm ?? VRMC_vrm_animation)?.humanoid?.humanBones ?? {};
    return new Map(
      Object.entries(bones as Record<string, { node: number }>).map(([bone, { node }]) => [bone, node]),
    );
  }

  name(node: number): string {
    return this.nodes[node]!.name || `node${node}`;
  }

  /** A node's translation, rotation and scale at rest. */
  private local(node: number): Required<Local> {
    const { matrix, translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] } = this.nodes[node]!;
    if (!matrix) return { translation, rotation, scale };
    const columns = [0, 4, 8].map((at) => matrix.slice(at, at + 3) as Vector);
    const sizes = columns.map((column) => Math.hypot(...column)) as Vector;
    const turn = quaternionOf(
      columns.map((column, at) => times(column, 1 / (sizes[at] || 1))) as [Vector, Vector, Vector],
    );
    return { translation: matrix.slice(12, 15) as Vector, rotation: turn, scale: sizes };
  }

  /** Where some nodes are, all their ancestors among them, at rest or with what is moved. */
  world(wanted: Set<number>, moved?: Map<number, Local>): Map<number, Placed> {
    const placed = new Map<number, Placed>();
    for (const node of this.order.filter((at) => wanted.has(at))) {
      const { translation, rotation, scale } = { ...this.local(node), ...moved?.get(node) };
      const turn = normalised(rotation);
      const axes = AXES.map((axis, at) => times(rotated(turn, axis), scale[at]!)) as Placed["linear"];
      const above = placed.get(this.parents[node]!);
      placed.set(
        node,
        above
          ? {
              turn: product(above.turn, turn),
              linear: axes.map((column) => mapped(above.linear, column)) as Placed["linear"],
              place: plus(above.place, mapped(above.linear, translation)),
            }
          : { turn, linear: axes, place: translation },
      );
    }
    return placed;
  }

  /** The rows of an accessor; FormatError if it is not in the file. */
  array(index: number): number[][] {
    const { bufferView, byteOffset, componentType, count, type, normalized, sparse } =
      this.document.accessors![index]!;
    const width = WIDTHS[type]!;
    if (!Number.isInteger(count))
      throw new FormatError(`accessor ${index} is broken: its count is not a whole number`);
    let rows: number[][];
    if (bufferView === undefined) {
      this.count(count * width);
      rows = Array.from({ length: count }, () => Array<number>(width).fill(0));
    } else {
      rows = this.rows(index, { bufferView, byteOffset }, componentType, count, width);
    }
    if (sparse) {
      const places = this.sparsePlaces(index, sparse, count);
      const values = this.rows(index, sparse.values, componentType, places.length, width);
      places.forEach((place, at) => (rows[place] = values[at]!));
    }
    if (!normalized) return rows;
    const [, most] = READERS[componentType]!;
    return rows.map((row) => row.map((value) => Math.max(value / most, -1)));
  }

  /** The rows, of some, that a sparse accessor replaces. */
  private sparsePlaces(index: number, { count, indices }: Sparse, rows: number): number[] {
    if (![5121, 5123, 5125].includes(indices.componentType))
      throw new FormatError(`accessor ${index} is broken: its sparse indices are not unsigned integers`);
    const places = this.rows(index, indices, indices.componentType, count, 1).map(([place]) => place!);
    if (places.some((place, at) => place >= rows || (at > 0 && place <= places[at - 1]!))) {
      throw new FormatError(
        `accessor ${index} is broken: its sparse indices do not rise, or reach beyond its ${rows} elements`,
      );
    }
    return places;
  }

  /** Elements of a part of an accessor, which names a view; FormatError beyond its buffer. */
  private rows(
    index: number,
    { bufferView, byteOffset = 0 }: Part,
    componentType: number,
    count: number,
    width: number,
  ): number[][] {
    const view = this.document.bufferViews![bufferView]!;
    if (view.extensions && Object.keys(view.extensions).length)
      throw new FormatError("its animations are packed by meshoptimizer: unpack the file first");
    const [size, , read] = READERS[componentType]!;
    const content = this.buffers[view.buffer]!;
    const start = (view.byteOffset ?? 0) + byteOffset;
    const stride = view.byteStride || size * width;
    const fits =
      Number.isInteger(count) &&
      count >= 0 &&
      start >= 0 &&
      stride >= size * width &&
      (!count || start + stride * (count - 1) + size * width <= content.length);
    if (!fits) throw new FormatError(`accessor ${index} extends beyond its buffer: the file is cut short`);
    this.count(count * width);
    const data = new DataView(content.buffer, content.byteOffset, content.byteLength);
    return Array.from({ length: count }, (_, row) =>
      Array.from({ length: width }, (_, column) => {
        const value = read(data, start + row * stride + column * size);
        if (!Number.isFinite(value))
          throw new FormatError(`accessor ${index} holds numbers that are not finite`);
        return value;
      }),
    );
  }

  /** Count numbers that are read, which a file has no more of than it can hold. */
  private count(numbers: number): void {
    this.numbers += numbers;
    const bytes = this.buffers.reduce((sum, buffer) => sum + buffer.length, 0);
    if (!(numbers >= 0 && this.numbers <= 4 * bytes))
      throw new FormatError("its arrays overlap: they hold more numbers than the file has bytes");
  }

  /** The bytes of a view of a buffer. */
  bytes(view: number): Uint8Array {
    const { buffer, byteOffset = 0, byteLength } = this.document.bufferViews![view]!;
    return this.buffers[buffer]!.subarray(byteOffset, byteOffset + byteLength);
  }

  /** Some nodes and all their ancestors. */
  above(nodes: Iterable<number>): Set<number> {
    const reached = new Set<number>();
    for (const node of nodes)
      for (let at = node; at >= 0 && !reached.has(at); at = this.parents[at]!) reached.add(at);
    return reached;
  }
}

/** A vector by a linear map. */
export function mapped(linear: Placed["linear"], [x, y, z]: Vector): Vector {
  return plus(plus(times(linear[0], x), times(linear[1], y)), times(linear[2], z));
}

/** The bytes of a data: URI. */
export function inlined(uri: string): Uint8Array {
  return bytesOf(uri.slice(uri.indexOf(",") + 1));
}

/** The JSON text and the binary part of a GLB file. */
function chunks(content: Uint8Array): { json: Uint8Array; binary: Uint8Array } {
  const view = new DataView(content.buffer, content.byteOffset, content.byteLength);
  const parts = new Map<number, Uint8Array>();
  for (let at = 12; at + 8 <= content.length;) {
    const length = view.getUint32(at, true);
    const kind = view.getUint32(at + 4, true);
    if (at + 8 + length > content.length)
      throw new FormatError("cut short: the GLB file ends within a chunk");
    if (!parts.has(kind)) parts.set(kind, content.subarray(at + 8, at + 8 + length));
    at += 8 + length;
  }
  const json = parts.get(0x4e4f534a);
  if (!json) throw new FormatError("cut short: the GLB file has no JSON chunk");
  return { json, binary: parts.get(0x004e4942) ?? new Uint8Array() };
}
