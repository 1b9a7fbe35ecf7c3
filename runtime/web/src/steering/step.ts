/* The step of a steered figure: docs/reference/bundle.md, the loop `matching`. Metres, seconds and radians. */
import { MATCHING } from "../generated.js";
import { BONES, OFFSETS } from "../figures/humanoid/bones.js";
import { type Matcher, type Playback, type Target } from "./matching.js";
import { lengthOf, moved, type Pose as Ground } from "../motion/planar.js";
import {
  about,
  inverse,
  minus,
  normalised,
  plus,
  product,
  type Quaternion,
  rotated,
  setTurn,
  turnAt,
  type Vector,
  Y,
} from "../motion/rotations.js";
import { clamp, damp, damped, dampingOf, wrapped } from "../motion/springs.js";
import { strided, warped } from "./warping.js";

/** A pose on the humanoid: the hips' rotation is in the frame of the facing. A figure has one, which each stage of a tick changes. */
export interface Played {
  ground: Ground;
  /** Quaternions of the humanoid's bones, in their order, four numbers each. */
  rotations: Float64Array;
  /** Metres of the hips above the ground. */
  height: number;
  /** From 0 to 1, how much the left and the right foot stand. */
  contacts: [left: number, right: number];
}

/** What of a pose is not where it is. */
export type Body = Pick<Played, "rotations" | "height">;

export function newPose(): Played {
  return { ground: [0, 0, 0], rotations: new Float64Array(4 * BONES.length), height: 0, contacts: [0, 0] };
}

/** Make a pose the same as another. */
export function copyPose(pose: Played, other: Played): void {
  pose.rotations.set(other.rotations);
  pose.height = other.height;
  for (let i = 0; i < 3; i++) pose.ground[i] = other.ground[i]!;
  pose.contacts[0] = other.contacts[0];
  pose.contacts[1] = other.contacts[1];
}

/** The kernel: the numbers of a bundle, and what they are computed with. */
export class Steerer {
  private readonly codes: Float64Array;
  private readonly mean: Float64Array;
  /** Of each bone what each code adds to its quaternion, and after all bones to the height. */
  private readonly basis: Float64Array;
  /** Of the row that is played, as `recordedMoves` writes them. */
  private readonly moves = new Float64Array(6);

  constructor(readonly matcher: Matcher) {
    this.codes = new Float64Array(matcher.codes);
    this.mean = Float64Array.from(matcher.tables.pose_mean);
    this.basis = byBone(matcher.tables.pose_basis, matcher.codes, this.mean.length);
  }

  /** The next pose, 1 / fps seconds later, written into one. */
  tick(figure: Playback, target: Target, gait: number, pose: Played): void {
    const { matcher } = this;
    const { settings, dt } = matcher;
    // search: jump to another row where one fits better
    matcher.search(figure, target, gait);
    // playback: go on by the playback rate
    const at = figure.part + figure.rate;
    figure.row += Math.floor(at);
    figure.part = at - Math.floor(at);
    // the springs approach the target, and the root follows them
    const { moves } = this;
    this.recordedMoves(figure);
    approach(figure, target, dampingOf(settings.velocity), dampingOf(settings.facing), dt);
    this.warp(figure, moves[3]!);
    // what has no speed, a jump, has its own rate; who comes to rest goes no faster than the springs
    const creeps = matcher.creeping(target, gait) && moves[3]! > 0;
    const rests =
      matcher.resting(figure, target, gait) && moves[3]! > lengthOf(figure.spring[0], figure.spring[1]);
    this.move(figure, creeps || rests);
    // inertialization: the offset of the last jumps fades
    damp(figure.offset, figure.offsetRate, dampingOf(settings.blend), dt);
    const left = Math.fround(moves[4]!);
    const right = Math.fround(moves[5]!); // so bounds are passed in the same ticks as in Python
    pose.contacts[0] = figure.mirror ? right : left;
    pose.contacts[1] = figure.mirror ? left : right;
    place(pose, figure);
    this.body(figure, pose);
  }

  /** What a figure plays, with its offset and turned as it goes: rotations and height of a pose. */
  body(figure: Playback, pose: Body): void {
    this.matcher.played(figure, this.codes);
    this.pose(pose);
    strided(pose.rotations, figure.stride);
    warped(pose.rotations, figure.warp);
  }

  /** So many rows from the first on, as `actOf` takes their frames. */
  recorded(first: number, count: number): number[] {
    const { tables, dt, codes } = this.matcher;
    const pose = newPose();
    let ground: Ground = [0, 0, 0];
    return Array.from({ length: count }, (_, at) => {
      const row = first + at;
      const move = (i: number) => tables.moves[6 * (first + at) + i]! * dt;
      if (at) ground = moved(ground, [move(0), move(1), move(2)]);
      this.codes.set(tables.codes.subarray(row * codes, (row + 1) * codes));
      this.pose(pose);
      return [...pose.rotations, ...ground, pose.height];
    }).flat();
  }

  /** Velocity over the ground (forward, left, turn), speed, and how much each foot stands, of the row as recorded. */
  private recordedMoves({ row, part }: Playback): void {
    const { moves } = this.matcher.tables;
    for (let i = 0, at = 6 * row; i < 6; i++, at++)
      this.moves[i] = moves[at]! + part * (moves[at + 6]! - moves[at]!);
  }

  /** By how much hips and legs are turned towards where the springs go, a tick later; by nothing if the row stands or goes elsewhere. */
  private warp(figure: Playback, recorded: number): void {
    const { matcher } = this;
    const { settings } = matcher;
    const x = figure.spring[0];
    const z = figure.spring[1];
    const angle = wrapped(Math.atan2(x, z) - figure.root[2] - matcher.way(figure));
    const warps = Math.min(recorded, lengthOf(x, z)) > settings.idle && Math.abs(angle) <= Math.PI / 2;
    const target = warps ? clamp(angle, -settings.warp, settings.warp) : 0;
    const [off, rate] = damped(figure.warp - target, figure.warpRate, dampingOf(settings.blend), matcher.dt);
    figure.warp = target + off;
    figure.warpRate = rate;
  }

  /** The next root, rate of playback and stride of the legs, of a figure that creeps or does not. */
  private move(figure: Playback, creeps: boolean): void {
    const { moves } = this;
    const { settings, dt } = this.matcher;
    const { root, rate, spring, mirror } = figure;
    const facing = root[2];
    const recorded = moves[3]!;
    const side = mirror ? -1 : 1;
    // how fast the springs go beside the recording
    const pace = lengthOf(spring[0], spring[1]);
    const moving = creeps || Math.min(recorded, pace) > settings.idle;
    const ratio = pace / Math.max(recorded, creeps ? MATCHING.LEAST_PACE : settings.idle);
    // stride: what the playback rate does not make up for of the speed
    const stride = moving ? clamp(ratio / rate, creeps ? 0 : settings.shortest, settings.longest) : 1;
    const by = rate * dt * stride;
    const forward = moves[0]! * by;
    const left = side * moves[1]! * by;
    const turn = side * moves[2]! * rate * dt;
    // turn as recorded, and a little more towards the facing of the springs
    const error = wrapped(spring[2] - facing);
    const most =
      (settings.turn_still + settings.turn_moving * Math.min(pace, settings.turn_speed)) * dt +
      settings.turn_turning * Math.abs(turn);
    const turned = wrapped(facing + turn + clamp(error * (1 - 0.5 ** (dt / settings.turn)), -most, most));
    // the step over the ground, turned as the legs are
    const sin = Math.sin(facing + figure.warp);
    const cos = Math.cos(facing + figure.warp);
    const stepX = sin * forward + cos * left;
    const stepZ = cos * forward - sin * left;
    // turned towards the velocity by a small angle, where the two do not go apart
    const along = stepX * spring[0] + stepZ * spring[1];
    const across = stepZ * spring[0] - stepX * spring[1];
    const veers = moving && along > settings.veer_within * Math.abs(across);
    const angle = veers ? clamp(Math.atan(across / Math.max(along, 1e-6)), -settings.veer, settings.veer) : 0;
    // a slow walk goes exactly as the springs do, whose ways recordings lack
    root[0] += creeps ? spring[0] * dt : stepX + angle * stepZ;
    root[1] += creeps ? spring[1] * dt : stepZ - angle * stepX;
    root[2] = turned;
    // the next playback rate; a slow walk shares the slowness between rate and stride
    const slowest = creeps ? settings.creep_slowest : settings.slowest;
    figure.rate = moving ? clamp(creeps ? Math.sqrt(ratio) : ratio, slowest, settings.fastest) : 1;
    // stride warping: the legs reach as far as the root goes
    const target = creeps ? Math.min(stride, 1) : 1;
    const [off, slower] = damped(figure.stride - target, figure.strideRate, dampingOf(settings.blend), dt);
    figure.stride = target + off;
    figure.strideRate = slower;
  }

  /** The pose of the codes: a linear map, then quaternions of unit length. */
  private pose(pose: Body): void {
    const { codes, mean, basis } = this;
    const { rotations } = pose;
    const count = codes.length;
    let at = 0;
    for (let i = 0; i < rotations.length; i += 4) {
      let x = mean[i]!;
      let y = mean[i + 1]!;
      let z = mean[i + 2]!;
      let w = mean[i + 3]!;
      for (let k = 0; k < count; k++, at += 4) {
        const code = codes[k]!;
        x += code * basis[at]!;
        y += code * basis[at + 1]!;
        z += code * basis[at + 2]!;
        w += code * basis[at + 3]!;
      }
      const size = Math.sqrt(Math.max(x * x + y * y + z * z + w * w, 1e-12));
      rotations[i] = x / size;
      rotations[i + 1] = y / size;
      rotations[i + 2] = z / size;
      rotations[i + 3] = w / size;
    }
    pose.height = mean[rotations.length]!;
    for (let k = 0; k < count; k++, at++) pose.height += codes[k]! * basis[at]!;
  }
}

/** A basis of codes by values, four values together. */
function byBone(basis: Float32Array, codes: number, values: number): Float64Array {
  const sorted = new Float64Array(basis.length);
  for (let i = 0, at = 0; i < values; i += 4)
    for (let k = 0; k < codes; k++)
      for (let j = i; j < Math.min(i + 4, values); j++, at++) sorted[at] = basis[k * values + j]!;
  return sorted;
}

/** Put a pose where its figure is. */
export function place(pose: Played, { root }: Playback): void {
  for (let i = 0; i < 3; i++) pose.ground[i] = root[i]!;
}

/** A point of the world in the frame of the last of some bones, of which each hangs on the one before and the first on the hips. */
export function seenBy(
  bones: readonly number[],
  { ground: [x, z, facing], height, rotations }: Played,
  point: Vector,
): Vector {
  let place: Vector = [x, height, z];
  let above = product(about(Y, facing), turnAt(rotations, 0));
  for (const bone of bones) {
    place = plus(place, rotated(above, OFFSETS[bone]!));
    above = product(above, turnAt(rotations, bone));
  }
  return rotated(inverse(above), minus(point, place));
}

/** The springs of velocity and facing, a tick later. */
function approach(figure: Playback, [x, z, facing]: Target, slow: number, calm: number, dt: number): void {
  const { spring, springRate } = figure;
  const [offX, rateX] = damped(spring[0] - x, springRate[0], slow, dt);
  const [offZ, rateZ] = damped(spring[1] - z, springRate[1], slow, dt);
  const [off, rate] = damped(wrapped(spring[2] - facing), springRate[2], calm, dt);
  spring[0] = x + offX;
  spring[1] = z + offZ;
  spring[2] = facing + off;
  springRate[0] = rateX;
  springRate[1] = rateZ;
  springRate[2] = rate;
}

/** The pose part of the way to another, which is near. */
export function between(pose: Played, other: Played, part: number): Played {
  const mixed = (a: number, b: number) => a + part * (b - a);
  const [x, z, facing] = pose.ground;
  const [toX, toZ, toFacing] = other.ground;
  const rotations = new Float64Array(pose.rotations.length);
  for (let bone = 0; bone < BONES.length; bone++) {
    const from = turnAt(pose.rotations, bone);
    const to = turnAt(other.rotations, bone);
    const side = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3] < 0 ? -1 : 1;
    const turn: Quaternion = [
      mixed(from[0], side * to[0]),
      mixed(from[1], side * to[1]),
      mixed(from[2], side * to[2]),
      mixed(from[3], side * to[3]),
    ];
    setTurn(rotations, bone, normalised(turn));
  }
  return {
    ground: [mixed(x, toX), mixed(z, toZ), facing + part * wrapped(toFacing - facing)],
    rotations,
    height: mixed(pose.height, other.height),
    contacts: [mixed(pose.contacts[0], other.contacts[0]), mixed(pose.contacts[1], other.contacts[1])],
  };
}
