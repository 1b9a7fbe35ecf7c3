/* Reading glTF 2.0 and VRM: a figure's joints, and its animations as clips; every angle is 0 in the rest pose of the nodes. */
import { GLTF, GLTF_DATA, SKELETON } from "../generated.js";
import { FormatError, MotionError } from "../errors.js";
import { type Animation, Gltf, type Local, type Placed } from "./gltfData.js";
import { BONES } from "../figures/humanoid/bones.js";
import { mapOf } from "../figures/humanoid/jointMap.js";
import { checked, type Motion, motionFrom } from "../motion/motion.js";
import { hermite, median, rounded, sumOf } from "../motion/numbers.js";
import { clamp } from "../motion/springs.js";
import {
  cross,
  dot,
  inverse,
  mean,
  minus,
  normalised,
  ofVector,
  product,
  type Quaternion,
  rotated,
  size,
  STILL,
  towards,
  unit,
  type Vector,
} from "../motion/rotations.js";
import { type Joint, type RestNode, Skeleton, unique } from "../motion/skeleton.js";

/** Numbers of a node's rotation, translation or scale. */
const WIDTHS: Record<string, number> = Object.fromEntries(
  Object.entries(GLTF_DATA.REST_TRANSFORM).map(([path, rest]) => [path, rest.length]),
);

/** The names of the animations that move a figure. FormatError as {@link readGLB}. */
export function clipsOf(content: Uint8Array): string[] {
  return guarded(() => {
    const gltf = Gltf.parse(content);
    const taken = new Set<string>();
    return clips(gltf, figures(gltf)).map(({ name }, at) => unique(name || `clip${at + 1}`, taken));
  });
}

/**
 * Read a clip of a .glb, .vrm, .vrma or .gltf file, by default the first, or the rest pose as one frame if there is
 * none; lengths are metres. Bones of a VRM humanoid get VRM's names. FormatError names what the file lacks.
 */
export function readGLB(content: Uint8Array, clip: number | string = 0): Motion {
  return guarded(() => {
    const gltf = Gltf.parse(content);
    const groups = figures(gltf);
    const animations = clips(gltf, groups);
    const at = typeof clip === "number" ? clip : animations.findIndex(({ name }) => name === clip);
    const animation = animations[at];
    if (!animation && (animations.length || clip !== 0))
      throw new FormatError(`no clip ${JSON.stringify(clip)}: the file has ${animations.length}`);
    return taken(gltf, groups, animation);
  });
}

/** What is misplaced or of a wrong type in a file becomes a FormatError. */
function guarded<T>(read: () => T): T {
  try {
    return read();
  } catch (error) {
    if (error instanceof FormatError) throw error;
    throw new FormatError(
      error instanceof MotionError ? error.message : `broken glTF file: ${String(error).slice(0, 200)}`,
    );
  }
}

function moves({ channels = [] }: Partial<Animation>): Set<number> {
  const targets = channels
    .map(({ target }) => target)
    .filter(({ node, path }) => WIDTHS[path] && node !== undefined);
  return new Set(targets.map(({ node }) => node!));
}

function clips(gltf: Gltf, groups: Set<number>[]): Animation[] {
  const animations = gltf.document.animations ?? [];
  const near = gltf.above(groups.flatMap((joints) => [...joints]));
  const moving = animations.filter((animation) => [...moves(animation)].some((node) => near.has(node)));
  if (animations.length && !moving.length)
    throw new FormatError("its animations move no joint of its skeleton");
  return moving;
}

/**
 * The joints of each figure by node: those of the skins and the humanoid, or else what animations move; both where the
 * skins' joints are no human's, and are one together with moved nodes.
 */
function figures(gltf: Gltf): Set<number>[] {
  const skins = gltf.document.skins ?? [];
  if (skins.length > GLTF.MAX_SKINS)
    throw new FormatError(`it has ${skins.length} skins: expected at most ${GLTF.MAX_SKINS}`);
  const bones = new Set(gltf.humanoid().values());
  const moved = new Set((gltf.document.animations ?? []).flatMap((animation) => [...moves(animation)]));
  const sets = [bones, ...skins.map(({ joints }) => new Set(joints))].filter((joints) => joints.size);
  const strange = sets.flatMap((joints) => [...joints]).filter((node) => !gltf.nodes[node]);
  if (strange.length) throw new FormatError(`joints that are not nodes: ${strange.slice(0, 5).join(", ")}`);
  const roots = heads(gltf, new Set(gltf.order.filter((node) => gltf.parents[node]! < 0)));
  const alone = animated(gltf, moved, roots);
  if (!sets.length) {
    if (!alone.size)
      throw new FormatError(
        "no skeleton: expected a skin with joints or a VRM humanoid; export the armature, too",
      );
    return grouped(gltf, [alone], moved, roots);
  }
  const groups = grouped(gltf, sets, moved, roots);
  if (bones.size) return groups.filter((joints) => [...joints].some((node) => bones.has(node)));
  const inside = gltf.above(groups.flatMap((joints) => [...joints]));
  if ([...alone].every((node) => inside.has(node)) || humans(gltf, groups).length) return groups;
  const wider = humans(gltf, grouped(gltf, [...sets, alone], moved, roots));
  return wider.length ? wider : groups;
}

/** Sets of joints put together that belong to one figure. */
function grouped(
  gltf: Gltf,
  sets: Set<number>[],
  moved: Set<number>,
  roots: Map<number, number>,
): Set<number>[] {
  const parts = sets.flatMap((joints) => byHead(joints, roots));
  const tops = parts.map((part) => top(gltf, part));
  const above = heads(gltf, new Set([...moved, ...tops]));
  const groups = new Map<number, Set<number>>();
  parts.forEach((part, at) => {
    const head = above.get(tops[at]!)!;
    groups.set(head, new Set([...(groups.get(head) ?? []), ...part]));
  });
  return [...groups.values()];
}

/** Those figures, of the ten with the most joints, that have names of a human's. */
function humans(gltf: Gltf, groups: Set<number>[]): Set<number>[] {
  return [...groups]
    .sort((a, b) => b.size - a.size)
    .slice(0, 10)
    .filter((joints) => isHuman(gltf, joints));
}

/** Whether joints have names of a human's. */
function isHuman(gltf: Gltf, joints: Set<number>): boolean {
  try {
    const nodes = jointsOf(gltf, joints);
    mapOf(skeletonOf(gltf, nodes, gltf.world(gltf.above(nodes))));
    return true;
  } catch (error) {
    if (error instanceof MotionError || error instanceof FormatError) return false;
    throw error;
  }
}

function byHead(joints: Set<number>, roots: Map<number, number>): Set<number>[] {
  const sizes = new Map<number, Set<number>>();
  for (const node of joints)
    sizes.set(roots.get(node)!, (sizes.get(roots.get(node)!) ?? new Set()).add(node));
  return [...sizes.values()];
}

/** In each tree the moved nodes and the bones below them, if some are below others; empty if none are. */
function animated(gltf: Gltf, moved: Set<number>, roots: Map<number, number>): Set<number> {
  const bones = new Set([...moved].filter((node) => gltf.nodes[node]!.camera === undefined));
  const hanging = new Set<number>();
  for (const node of gltf.order) {
    const { mesh, camera } = gltf.nodes[node]!;
    const parent = gltf.parents[node]!;
    if (
      (bones.has(parent) || hanging.has(parent)) &&
      (bones.has(node) || (mesh === undefined && camera === undefined))
    )
      hanging.add(node);
  }
  const trees = new Set([...bones].filter((node) => hanging.has(node)).map((node) => roots.get(node)));
  return new Set([...bones, ...hanging].filter((node) => trees.has(roots.get(node))));
}

/** The highest of some nodes that each node is or is below. */
function heads(gltf: Gltf, among: Set<number>): Map<number, number> {
  const numbers = new Map<number, number>();
  for (const node of gltf.order) {
    const above = numbers.get(gltf.parents[node]!);
    if (above !== undefined || among.has(node)) numbers.set(node, above ?? node);
  }
  return numbers;
}

/** The lowest node that all of a part are or are below. */
function top(gltf: Gltf, part: Set<number>): number {
  const inOrder = gltf.order.filter((node) => part.has(node));
  const line = gltf.above([inOrder[0]!]);
  let at = inOrder.at(-1)!;
  while (!line.has(at)) at = gltf.parents[at]!;
  return at;
}

/** The figure of a parsed file at rest: the one with the most joints, the node of each joint, and where nodes are. */
export function restOf(gltf: Gltf): { skeleton: Skeleton; joints: number[]; rest: Map<number, Placed> } {
  return guarded(() => {
    const joints = jointsOf(
      gltf,
      figures(gltf).reduce((best, group) => (group.size > best.size ? group : best)),
    );
    const rest = gltf.world(new Set(gltf.order));
    return { skeleton: skeletonOf(gltf, joints, rest), joints, rest };
  });
}

/** The figure that an animation moves most, counting its ancestors, else that with the most joints, in the animation's frames. */
function taken(gltf: Gltf, groups: Set<number>[], animation?: Animation): Motion {
  const moved = animation ? moves(animation) : new Set<number>();
  const weight = (joints: Set<number>) =>
    [...gltf.above(joints)].filter((node) => moved.has(node)).length * GLTF.MAX_JOINTS + joints.size;
  const joints = jointsOf(
    gltf,
    groups.reduce((best, group) => (weight(group) > weight(best) ? group : best)),
  );
  const near = gltf.above(joints);
  const rest = gltf.world(near);
  const { frames, fps } = animation
    ? tracks(gltf, animation, near)
    : { frames: [new Map<number, Local>()], fps: 30 };
  const skeleton = skeletonOf(gltf, joints, rest);
  const turns: Quaternion[][] = [];
  const places: Vector[][] = [];
  const children = joints.map((node) => joints.filter((other) => gltf.parents[other] === node));
  const worlds = frames.map((values) => gltf.world(near, values));
  const sheared = joints.map(
    (node, at) => children[at]!.length > 0 && worlds.some((world) => isSheared(world.get(node)!)),
  );
  for (const world of worlds) {
    const turned = (node: number, at: number): Quaternion => {
      const turn = product(world.get(node)!.turn, inverse(rest.get(node)!.turn));
      if (!sheared[at]) return turn;
      const place = world.get(node)!.place;
      const atRest = rest.get(node)!.place;
      return turnedOnto(
        turn,
        children[at]!.map((child) => [
          minus(rest.get(child)!.place, atRest),
          minus(world.get(child)!.place, place),
        ]),
      );
    };
    turns.push(joints.map(turned));
    places.push(joints.map((node) => world.get(node)!.place));
  }
  return checked({
    ...motionFrom(skeleton, turns, moving(skeleton, turns, places), fps),
    travels: animation !== undefined,
  });
}

/** Whether unequal scales above a node stretch it, so that its map has columns of other lengths or not at right angles. */
function isSheared({ linear }: Placed): boolean {
  const size = linear.reduce((sum, column) => sum + dot(column, column), 0) / 3;
  return linear.some((column, i) =>
    linear.some((other, j) => Math.abs(dot(column, other) - (i === j ? size : 0)) > 1e-3 * size),
  );
}

/** The rotation that takes bones at rest closest to what they are: a few steps from one that is some degrees off. */
function turnedOnto(turn: Quaternion, bones: [atRest: Vector, bone: Vector][]): Quaternion {
  const long = bones
    .filter(([atRest, bone]) => size(atRest) > 0 && size(bone) > 0)
    .map(([atRest, bone]) => [unit(atRest), unit(bone)] as const);
  let result = turn;
  for (let step = 0; step < 30 && long.length; step++) {
    result = product(
      ofVector(mean(long.map(([atRest, bone]) => cross(rotated(result, atRest), bone)))),
      result,
    );
  }
  return normalised(result);
}

/** The joints and the nodes between them, with the ends attached to them, parents first. */
function jointsOf(gltf: Gltf, joints: Set<number>): number[] {
  const outside = gltf.above([gltf.parents[top(gltf, joints)]!]);
  const inside = new Set([...gltf.above(joints)].filter((node) => !outside.has(node)));
  const ends = (node: number) =>
    gltf.name(node).endsWith(SKELETON.END_SUFFIX) &&
    inside.has(gltf.parents[node]!) &&
    !gltf.nodes[node]!.children?.length;
  const nodes = gltf.order.filter((node) => inside.has(node) || ends(node));
  if (nodes.length > GLTF.MAX_JOINTS)
    throw new FormatError(`its skeleton has ${nodes.length} joints: expected at most ${GLTF.MAX_JOINTS}`);
  return nodes;
}

function skeletonOf(gltf: Gltf, joints: number[], rest: Map<number, Placed>): Skeleton {
  const bones = new Map(
    [...gltf.humanoid()].filter(([bone]) => BONES.includes(bone)).map(([bone, node]) => [node, bone]),
  );
  const used = new Set<string>();
  const reserved = new Set<string>(bones.values());
  const chain = joints.map((node): Joint => {
    const name = unique(gltf.name(node), used);
    const parent = joints.indexOf(gltf.parents[node]!);
    const place = rest.get(node)!.place;
    const offset = parent < 0 ? place : minus(place, rest.get(joints[parent]!)!.place);
    return { name: bones.get(node) ?? unique(name, reserved), parent, offset, order: "zyx" };
  });
  const nodes = joints.map((node) => restNode(gltf, node, rest));
  return new Skeleton(chain, 1, nodes);
}

function restNode(gltf: Gltf, node: number, rest: Map<number, Placed>): RestNode {
  const above = rest.get(gltf.parents[node]!);
  // a scale that differs by axis counts as the even one of the same volume
  const scale = above
    ? Math.cbrt(Math.abs(dot(cross(above.linear[0], above.linear[1]), above.linear[2])))
    : 1;
  const { turn, place } = above ?? { turn: STILL, place: [0, 0, 0] };
  return { name: gltf.name(node), turn: rest.get(node)!.turn, above: { turn, scale, place } };
}

/** Translations in their parents' frames of the root, and of joints that leave their offset. */
function moving(skeleton: Skeleton, turns: Quaternion[][], places: Vector[][]): Map<number, Vector[]> {
  const moved = new Map([[0, places.map((pose) => pose[0]!)]]);
  const still = 1e-4 * Math.max(skeleton.height, 1e-9);
  skeleton.joints.forEach(({ parent, offset }, at) => {
    if (parent < 0) return;
    const local = places.map((pose, frame) =>
      rotated(inverse(turns[frame]![parent]!), minus(pose[at]!, pose[parent]!)),
    );
    if (local.some((move) => Math.max(...minus(move, offset).map(Math.abs)) > still)) moved.set(at, local);
  });
  return moved;
}

interface Keys {
  node: number;
  path: string;
  times: number[];
  values: number[][];
  kind: string;
}

/** What is moved in every frame of an animation, of some nodes, and its frame rate. */
function tracks(
  gltf: Gltf,
  animation: Animation,
  nodes: Set<number>,
): { frames: Map<number, Local>[]; fps: number } {
  const keys: Keys[] = [];
  for (const {
    sampler,
    target: { node, path },
  } of animation.channels) {
    if (node === undefined || !nodes.has(node) || !WIDTHS[path]) continue;
    const { input, output, interpolation = "LINEAR" } = animation.samplers[sampler]!;
    const times = gltf.array(input).map(([time]) => time!);
    const values = gltf.array(output);
    if (
      !times.length ||
      values.length !== times.length * (interpolation === "CUBICSPLINE" ? 3 : 1) ||
      values[0]!.length !== WIDTHS[path]
    ) {
      throw new FormatError("its animation has tracks without keys, or with others than it says");
    }
    keys.push({ node, path, times, values, kind: interpolation });
  }
  const start = Math.min(...keys.map(({ times }) => times[0]!));
  const end = Math.max(...keys.map(({ times }) => times.at(-1)!));
  const fps = rateOf(keys.map(({ times }) => times));
  const count = (end - start) * fps + 1;
  if (!(count * gltf.nodes.length < 1e7))
    throw new FormatError(`${end - start} s at ${fps} fps is too many frames`);
  const frames = Array.from({ length: Math.round(count) }, (_, frame) => {
    const moved = new Map<number, Local>();
    for (const key of keys)
      moved.set(key.node, { ...moved.get(key.node), [key.path]: sampled(key, start + frame / fps) });
    return moved;
  });
  return { frames, fps };
}

/**
 * The frame rate that the times of keys tell, in seconds: that of the closest keys, 30 if none is near.
 *
 * Times are 32-bit numbers, so a step between two is rough: it is measured over all whole steps of its track.
 */
export function rateOf(tracks: number[][]): number {
  let least = 0;
  for (const times of tracks.filter(({ length }) => length > 1)) {
    const gaps = times.slice(1).map((time, at) => time - times[at]!);
    let step = median(gaps);
    if (step > 0) {
      const whole = gaps.map((gap) => rounded(gap / step));
      const total = sumOf(whole);
      if (total > 0 && gaps.every((gap, at) => Math.abs(gap - whole[at]! * step) < 0.01 * step))
        step = (times.at(-1)! - times[0]!) / total;
    }
    least = least ? Math.min(least, step) : step;
  }
  if (!(least > 0 && least < 0.1)) return 30; // keys further apart do not tell a frame rate
  const rate = 1 / least;
  // a rate is whole, or like 29.97, where the times cannot tell it from that
  for (const [digits, error] of [
    [0, 1e-4],
    [2, 1e-6],
    [3, 1e-6],
  ] as const) {
    const near = Math.round(rate * 10 ** digits) / 10 ** digits;
    if (Math.abs(rate - near) < error * rate) return near;
  }
  return rate;
}

/** A track's value at a time: linear (turns the shortest way), in steps, or by the tangents of splines. */
function sampled({ times: at, values, kind, path }: Keys, time: number): number[] {
  let before = 0;
  let end = Math.max(at.length - 1, 1);
  while (end - before > 1) {
    const middle = (before + end) >> 1;
    [before, end] = at[middle]! > time + 1e-6 ? [before, middle] : [middle, end];
  }
  const next = Math.min(before + 1, at.length - 1);
  const span = Math.max(at[next]! - at[before]!, 1e-9);
  const t = clamp((time - at[before]!) / span, 0, 1);
  if (kind === "CUBICSPLINE") {
    const p = values[3 * before + 1]!;
    const out = values[3 * before + 2]!;
    const arrive = values[3 * next]!;
    const q = values[3 * next + 1]!;
    return p.map((value, i) => hermite(value, span * out[i]!, q[i]!, span * arrive[i]!, t));
  }
  const low = values[before]!;
  const high = values[next]!;
  if (kind === "STEP") return t < 1 - 1e-4 ? low : high;
  return path === "rotation"
    ? towards(normalised(low as Quaternion), normalised(high as Quaternion), t)
    : low.map((value, i) => value + t * (high[i]! - value));
}
