/* The step of a steered figure: docs/reference/bundle.md, the loop `matching`. Metres, seconds and radians. */
import { MATCHING } from "../generated.js";
import { type Matcher, type Playback, type Target } from "./matching.js";
import { moved, type Pose as Ground } from "../motion/planar.js";
import type { Quaternion } from "../motion/rotations.js";
import { clamp, damped, dampingOf, wrapped } from "../motion/springs.js";
import { strided, warped } from "./warping.js";

/** A pose on the humanoid: the hips' rotation is in the frame of the facing. */
export interface Played {
  ground: Ground;
  /** Of the humanoid's bones, in their order. */
  rotations: Quaternion[];
  /** Metres of the hips above the ground. */
  height: number;
  /** From 0 to 1, how much the left and the right foot stand. */
  contacts: [left: number, right: number];
}

/** The kernel: the numbers of a bundle, and what they are computed with. */
export class Steerer {
  private readonly codes: Float64Array;
  private readonly values: Float64Array;
  private readonly mean: Float64Array;
  private readonly basis: Float64Array;

  constructor(readonly matcher: Matcher) {
    // four codes are added at once; there are 0 more of them where that leaves a rest
    this.codes = new Float64Array(4 * Math.ceil(matcher.codes / 4));
    this.mean = Float64Array.from(matcher.tables.pose_mean);
    this.basis = new Float64Array(this.codes.length * this.mean.length);
    this.basis.set(matcher.tables.pose_basis);
    this.values = new Float64Array(this.mean.length);
  }

  /** The next pose, 1 / fps seconds later. */
  tick(figure: Playback, target: Target, gait: number): Played {
    const { matcher } = this;
    const { settings, dt } = matcher;
    // search: jump to another row where one fits better
    matcher.search(figure, target, gait);
    // playback: go on by the playback rate
    const at = figure.part + figure.rate;
    figure.row += Math.floor(at);
    figure.part = at - Math.floor(at);
    // the springs approach the target, and the root follows them
    const moves = this.moves(figure);
    approach(figure, target, dampingOf(settings.velocity), dampingOf(settings.facing), dt);
    this.warp(figure, moves[3]!);
    // what has no speed, a jump, has its own rate; who comes to rest goes no faster than the springs
    const creeps = matcher.creeping(target, gait) && moves[3]! > 0;
    const rests =
      matcher.resting(figure, target, gait) && moves[3]! > Math.hypot(figure.spring[0], figure.spring[1]);
    this.move(figure, moves, creeps || rests);
    // inertialization: the offset of the last jumps fades
    this.fade(figure, dampingOf(settings.blend));
    const left = Math.fround(moves[4]!);
    const right = Math.fround(moves[5]!); // so bounds are passed in the same ticks as in Python
    const contacts: [number, number] = figure.mirror ? [right, left] : [left, right];
    return { ground: figure.root, ...this.body(figure), contacts };
  }

  /** What a figure plays, with its offset and turned as it goes. */
  body(figure: Playback): Pick<Played, "rotations" | "height"> {
    this.matcher.played(figure, this.codes);
    const { rotations, height } = this.pose();
    const legs = strided(rotations, figure.stride);
    return { rotations: warped(legs, figure.warp), height };
  }

  /** So many rows from the first on, as `actOf` takes their frames. */
  recorded(first: number, count: number): number[] {
    const { tables, dt, codes } = this.matcher;
    let ground: Ground = [0, 0, 0];
    return Array.from({ length: count }, (_, at) => {
      const row = first + at;
      const move = (i: number) => tables.moves[6 * (first + at) + i]! * dt;
      if (at) ground = moved(ground, [move(0), move(1), move(2)]);
      this.codes.set(tables.codes.subarray(row * codes, (row + 1) * codes));
      const { rotations, height } = this.pose();
      return [...rotations.flat(), ...ground, height];
    }).flat();
  }

  /** Velocity over the ground (forward, left, turn), speed, and how much each foot stands, of the row as recorded. */
  private moves({ row, part }: Playback): number[] {
    const { moves } = this.matcher.tables;
    return [0, 1, 2, 3, 4, 5].map(
      (i) => moves[6 * row + i]! + part * (moves[6 * row + 6 + i]! - moves[6 * row + i]!),
    );
  }

  /** By how much hips and legs are turned towards where the springs go, a tick later; by nothing if the row stands or goes elsewhere. */
  private warp(figure: Playback, recorded: number): void {
    const { matcher } = this;
    const { settings } = matcher;
    const [x, z] = figure.spring;
    const angle = wrapped(Math.atan2(x, z) - figure.root[2] - matcher.way(figure));
    const warps = Math.min(recorded, Math.hypot(x, z)) > settings.idle && Math.abs(angle) <= Math.PI / 2;
    const target = warps ? clamp(angle, -settings.warp, settings.warp) : 0;
    const [off, rate] = damped(figure.warp - target, figure.warpRate, dampingOf(settings.blend), matcher.dt);
    figure.warp = target + off;
    figure.warpRate = rate;
  }

  /** The next root, rate of playback and stride of the legs, of a figure that creeps or does not. */
  private move(figure: Playback, moves: number[], creeps: boolean): void {
    const { settings, dt } = this.matcher;
    const {
      root: [x, z, facing],
      rate,
      spring,
      mirror,
    } = figure;
    const recorded = moves[3]!;
    const side = mirror ? -1 : 1;
    // how fast the springs go beside the recording
    const pace = Math.hypot(spring[0], spring[1]);
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
    figure.root = creeps
      ? [x + spring[0] * dt, z + spring[1] * dt, turned]
      : [x + stepX + angle * stepZ, z + stepZ - angle * stepX, turned];
    // the next playback rate; a slow walk shares the slowness between rate and stride
    const slowest = creeps ? settings.creep_slowest : settings.slowest;
    figure.rate = moving ? clamp(creeps ? Math.sqrt(ratio) : ratio, slowest, settings.fastest) : 1;
    // stride warping: the legs reach as far as the root goes
    const target = creeps ? Math.min(stride, 1) : 1;
    const [off, slower] = damped(figure.stride - target, figure.strideRate, dampingOf(settings.blend), dt);
    figure.stride = target + off;
    figure.strideRate = slower;
  }

  /** The inertialization offset, a tick later. */
  private fade({ offset, offsetRate }: Playback, damping: number): void {
    const { dt } = this.matcher;
    const left = Math.exp(-damping * dt);
    for (let k = 0; k < offset.length; k++) {
      const rise = (offsetRate[k]! + damping * offset[k]!) * dt;
      offset[k] = (offset[k]! + rise) * left;
      offsetRate[k] = (offsetRate[k]! - damping * rise) * left;
    }
  }

  /** The pose of the codes: a linear map, then quaternions of unit length. */
  private pose(): { rotations: Quaternion[]; height: number } {
    const { values, mean, basis, codes } = this;
    const count = values.length;
    values.set(mean);
    for (let k = 0; k < codes.length; k += 4) {
      const a = codes[k]!;
      const b = codes[k + 1]!;
      const c = codes[k + 2]!;
      const d = codes[k + 3]!;
      for (let i = 0, at = k * count; i < count; i++, at++) {
        values[i]! +=
          a * basis[at]! + b * basis[at + count]! + c * basis[at + 2 * count]! + d * basis[at + 3 * count]!;
      }
    }
    const rotations: Quaternion[] = [];
    for (let at = 0; at < count - 1; at += 4) {
      const x = values[at]!;
      const y = values[at + 1]!;
      const z = values[at + 2]!;
      const w = values[at + 3]!;
      const size = Math.sqrt(Math.max(x * x + y * y + z * z + w * w, 1e-12));
      rotations.push([x / size, y / size, z / size, w / size]);
    }
    return { rotations, height: values[count - 1]! };
  }
}

/** The springs of velocity and facing, a tick later. */
function approach(figure: Playback, [x, z, facing]: Target, slow: number, calm: number, dt: number): void {
  const { spring, springRate } = figure;
  const [offX, rateX] = damped(spring[0] - x, springRate[0], slow, dt);
  const [offZ, rateZ] = damped(spring[1] - z, springRate[1], slow, dt);
  const [off, rate] = damped(wrapped(spring[2] - facing), springRate[2], calm, dt);
  figure.spring = [x + offX, z + offZ, facing + off];
  figure.springRate = [rateX, rateZ, rate];
}

/** The pose part of the way to another, which is near. */
export function between(pose: Played, other: Played, part: number): Played {
  const mixed = (a: number, b: number) => a + part * (b - a);
  const [x, z, facing] = pose.ground;
  const [toX, toZ, toFacing] = other.ground;
  const rotations = pose.rotations.map(([a, b, c, d], at): Quaternion => {
    const [e, f, g, h] = other.rotations[at]!;
    const side = a * e + b * f + c * g + d * h < 0 ? -1 : 1;
    const quaternion: Quaternion = [
      mixed(a, side * e),
      mixed(b, side * f),
      mixed(c, side * g),
      mixed(d, side * h),
    ];
    const size = Math.hypot(...quaternion);
    return [quaternion[0] / size, quaternion[1] / size, quaternion[2] / size, quaternion[3] / size];
  });
  return {
    ground: [mixed(x, toX), mixed(z, toZ), facing + part * wrapped(toFacing - facing)],
    rotations,
    height: mixed(pose.height, other.height),
    contacts: [mixed(pose.contacts[0], other.contacts[0]), mixed(pose.contacts[1], other.contacts[1])],
  };
}
