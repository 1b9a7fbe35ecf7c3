/* Motion matching, which recorded frame a figure plays next: docs/reference/bundle.md, the loop `matching`. Metres, seconds, radians. */
import { MATCHING, STEERING, steeringSettings } from "../generated.js";
import { Goals, UNIT } from "./goals.js";
import { lengthOf, type Pose as Ground } from "../motion/planar.js";
import { clamp, damped, dampedPath, dampingOf, wrapped } from "../motion/springs.js";
import type { Settings } from "../settings.js";

/** The tables of a bundle, row by row: N rows, K codes of a pose, G gaits, P numbers of a pose. */
export interface Tables {
  codes: Float32Array;
  moves: Float32Array;
  features: Int8Array;
  shows: Uint8Array;
  left: Int32Array;
  feature_mean: Float32Array;
  feature_scale: Float32Array;
  pose_mean: Float32Array;
  pose_basis: Float32Array;
}

/** Velocity along x and z, m/s, and facing, radians. */
export type Target = [x: number, z: number, facing: number];

/** What one figure plays, and where it is. */
export interface Playback {
  row: number;
  /** The part of the way to the next row. */
  part: number;
  mirror: boolean;
  /** Rows that are played in the next tick. */
  rate: number;
  ticksToSearch: number;
  /** Whether it searches in its turn alone, or whenever it is told something. */
  inTurn: boolean;
  root: Ground;
  /** The springs that approach the target, and how fast they change. */
  spring: Target;
  springRate: Target;
  /** The inertialization offset of the codes, and how fast it changes. */
  offset: Float64Array;
  offsetRate: Float64Array;
  /** Radians by which hips and legs are turned towards the direction of travel, and how fast that changes. */
  warp: number;
  warpRate: number;
  /** How long the legs' strides are beside the recorded ones, and how fast that changes. */
  stride: number;
  strideRate: number;
}

/** Features that are asked are no larger, on either side of 0. */
const LARGEST = 16;

/** Triples of a mirror image: of feet, their velocities, hips and hands, in the order of the other side's. */
const SWAPPED = [1, 0, 3, 2, 4, 6, 5];
const COLUMNS = [
  ...Array(MATCHING.TRAJECTORY).keys(),
  ...SWAPPED.flatMap((three) => [0, 1, 2].map((i) => MATCHING.TRAJECTORY + 3 * three + i)),
];
/** To the left is the first of a pair or a triple. */
const SIGNS = COLUMNS.map((_, i) =>
  i < MATCHING.TRAJECTORY
    ? i % 2 || i === MATCHING.TRAJECTORY - 1
      ? 1
      : -1
    : (i - MATCHING.TRAJECTORY) % 3
      ? 1
      : -1,
);

/** Of each row the angle from the facing to where its recording goes in the stride around it. */
function waysOf({ moves, left }: Tables): Float64Array {
  const rows = left.length;
  const forward = new Float64Array(rows + 1);
  const aside = new Float64Array(rows + 1);
  for (let row = 0; row < rows; row++) {
    forward[row + 1] = forward[row]! + moves[6 * row]!;
    aside[row + 1] = aside[row]! + moves[6 * row + 1]!;
  }
  let start = 0; // of the recording
  return Float64Array.from({ length: rows }, (_, row) => {
    if (row && row + left[row]! !== row - 1 + left[row - 1]!) start = row;
    const first = Math.max(start, row - MATCHING.STRIDE_ROWS);
    const stop = Math.min(row + left[row]!, row + MATCHING.STRIDE_ROWS) + 1;
    return Math.atan2(aside[stop]! - aside[first]!, forward[stop]! - forward[first]!);
  });
}

/** Searches the tables for a gait's best row, and jumps there. */
export class Matcher {
  readonly rows: number;
  readonly codes: number;
  readonly dt: number;
  /** Rows that are played until the next search, at most. */
  readonly reserve: number;
  /** Of each code of a mirror image its sign. */
  private readonly codeSigns: Float64Array;
  private readonly ways: Float64Array;
  private readonly features: Int16Array;
  readonly goals: Goals[];
  /** Of each gait whether it can go slower than its recordings. */
  readonly creeps: boolean[];
  private readonly query = new Int16Array(MATCHING.FEATURES);
  private readonly image = new Int16Array(MATCHING.FEATURES);

  constructor(
    readonly tables: Tables,
    odd: number,
    readonly gaits: number,
    readonly settings: Settings<typeof steeringSettings>,
    readonly fps: number,
  ) {
    this.rows = tables.left.length;
    this.codes = tables.codes.length / this.rows;
    this.dt = 1 / fps;
    this.ways = waysOf(tables);
    this.reserve = Math.ceil((settings.search_every + 1) * settings.fastest) + 2;
    this.codeSigns = Float64Array.from({ length: this.codes }, (_, k) => (k < this.codes - odd ? 1 : -1));
    this.features = Int16Array.from(
      tables.features,
      (step) => (step * MATCHING.STEPS) / STEERING.FEATURE_STEPS,
    );
    const lasts = (row: number) =>
      tables.left[row]! >= Math.max(this.reserve, settings.lasting) && !this.flies(row);
    // what is played at its own rate leads to a leap, with arms that swing: it is entered well before
    const soon = Array.from({ length: settings.prepares + 1 }, (_, at) => at);
    const leaps = (row: number) =>
      !tables.moves[6 * row + 3] && soon.some((at) => row + at < this.rows && this.flies(row + at));
    const all = [...Array(this.rows).keys()].filter((row) => lasts(row) && !leaps(row));
    this.goals = Array.from({ length: gaits }, (_, gait) => {
      const rows = all.filter((row) => this.shows(row, gait)).filter((_, at) => at % settings.row_step === 0);
      return new Goals(
        this.features,
        MATCHING.FEATURES,
        rows,
        tables.feature_mean,
        tables.feature_scale,
        settings.lag,
      );
    });
    this.creeps = Array.from({ length: gaits }, (_, gait) => {
      const speeds = Float32Array.from({ length: this.rows }, (_, row) =>
        this.shows(row, gait) ? tables.moves[6 * row + 3]! : 0,
      );
      const moving = speeds.filter((speed) => speed > settings.idle).sort();
      return moving.length > 0 && moving[moving.length >> 1]! > settings.creep;
    });
  }

  /** Whether a figure is to go slower than recordings do. */
  creeping([x, z]: Target, gait: number): boolean {
    const pace = lengthOf(x, z);
    return this.creeps[gait]! && pace >= MATCHING.LEAST_PACE / 2 && pace < this.settings.creep;
  }

  /** Whether a figure is to stand, and goes no faster than a slow walk. */
  resting({ spring }: Playback, [x, z]: Target, gait: number): boolean {
    return this.creeps[gait]! && !x && !z && lengthOf(spring[0], spring[1]) < this.settings.creep;
  }

  /** What a velocity over the ground is multiplied by to be as fast as recordings. */
  private hurry(x: number, z: number): number {
    const { creep } = this.settings;
    const pace = lengthOf(x, z);
    return pace < creep ? creep / Math.max(pace, Math.min(MATCHING.LEAST_PACE, creep)) : 1;
  }

  /** The row of a gait with the least speed, the first of them; of those that something follows, on the ground. */
  stillest(gait: number): number {
    let still = -1;
    for (let row = 0; row < this.rows; row++) {
      if (!this.shows(row, gait) || this.tables.left[row]! < this.reserve || this.flies(row)) continue;
      if (still < 0 || this.tables.moves[6 * row + 3]! < this.tables.moves[6 * still + 3]!) still = row;
    }
    return still;
  }

  /** A figure at a place that plays a row; with a phase it searches in its turn alone, first after so many ticks. */
  playing(row: number, [x, z, facing]: Ground = [0, 0, 0], phase?: number): Playback {
    const offset = new Float64Array(this.codes);
    const offsetRate = new Float64Array(this.codes);
    const springs = { spring: [0, 0, facing] as Target, springRate: [0, 0, 0] as Target, offset, offsetRate };
    const turn = { ticksToSearch: phase ?? 0, inTurn: phase !== undefined };
    const legs = { warp: 0, warpRate: 0, stride: 1, strideRate: 0 };
    return { row, part: 0, mirror: false, rate: 1, ...turn, root: [x, z, facing], ...springs, ...legs };
  }

  shows(row: number, gait: number): boolean {
    return this.tables.shows[row * this.gaits + gait]! > 0;
  }

  /** The angle from the facing to where a figure's row goes. */
  way({ row, mirror }: Playback): number {
    return mirror ? -this.ways[row]! : this.ways[row]!;
  }

  /** Whether no foot stands. */
  private flies(row: number): boolean {
    return Math.max(this.tables.moves[6 * row + 4]!, this.tables.moves[6 * row + 5]!) < this.settings.stands;
  }

  /** Let a figure whose search is due jump to the row that fits best, where another than its own does. */
  search(figure: Playback, target: Target, gait: number): void {
    if (figure.ticksToSearch-- > 0) return;
    const { settings } = this;
    figure.ticksToSearch = settings.search_every - 1;
    // the nearest row that is played: one in mid-air is never left, one that goes on may be kept
    const row = figure.row + (figure.part > 0.5 ? 1 : 0);
    const lasts = this.tables.left[row]! >= this.reserve;
    if (lasts && this.flies(row)) return; // who flies lands first
    const stays = lasts && this.shows(row, gait);
    // what is wanted: how the row is now, and where the springs lead
    const goals = this.goals[gait]!;
    const creeps = this.creeping(target, gait);
    this.ask(figure, row, target, creeps);
    // the cheapest row of the gait; to go on costs less by the bias, if the row may be kept
    const here = figure.mirror ? this.image : this.query;
    const bias = creeps ? 0 : settings.continuing * UNIT;
    const bound = stays ? goals.cost(here, this.features, row * MATCHING.FEATURES) - bias : Infinity;
    const nearest = goals.nearest(this.query, this.image, bound);
    if (!nearest) return;
    // a row that comes soon by itself needs no jump
    const ahead = nearest.row - row;
    if (!stays || ahead < -settings.jump_back || ahead > settings.jump_ahead)
      this.jump(figure, nearest.row, nearest.mirror);
  }

  /** What is asked for, as steps of features, and their mirror image: the row's own but for where it goes. */
  private ask(figure: Playback, row: number, target: Target, creeps: boolean): void {
    const { query } = this;
    const at = row * MATCHING.FEATURES;
    for (let i = MATCHING.TRAJECTORY; i < MATCHING.FEATURES; i++) {
      query[i] = figure.mirror ? this.features[at + COLUMNS[i]!]! * SIGNS[i]! : this.features[at + i]!;
    }
    this.lead(figure, target, creeps);
  }

  /** Ask for where the springs lead, and for the mirror image of all that is asked. */
  private lead(figure: Playback, target: Target, creeps: boolean): void {
    const { query, image } = this;
    const { feature_mean: mean, feature_scale: scale } = this.tables;
    this.trajectory(figure, target, creeps).forEach(
      (value, i) => (query[i] = stepsOf((value - mean[i]!) * scale[i]!)),
    );
    for (let i = 0; i < MATCHING.FEATURES; i++) image[i] = query[COLUMNS[i]!]! * SIGNS[i]!;
  }

  /** Where the springs lead, as features that are not yet scaled. */
  private trajectory({ root, spring, springRate }: Playback, target: Target, creeps: boolean): number[] {
    const toFacing = target[2];
    const by = creeps ? this.hurry(spring[0], spring[1]) : 1;
    const more = creeps ? this.hurry(target[0], target[1]) : 1;
    const toX = target[0] * more;
    const toZ = target[1] * more;
    const rateX = springRate[0] * by;
    const rateZ = springRate[1] * by;
    const { velocity, facing: halfLife, half_speed, horizon } = this.settings;
    const slow = dampingOf(velocity);
    const calm = dampingOf(halfLife);
    const cos = Math.cos(root[2]);
    const sin = Math.sin(root[2]);
    const offX = spring[0] * by - toX;
    const offZ = spring[1] * by - toZ;
    const off = wrapped(spring[2] - toFacing);
    const places: number[] = [];
    const facings: number[] = [];
    for (const time of [horizon / 3, (horizon * 2) / 3, horizon]) {
      const x = toX * time + dampedPath(offX, rateX, slow, time);
      const z = toZ * time + dampedPath(offZ, rateZ, slow, time);
      const angle = toFacing + damped(off, springRate[2], calm, time)[0] - root[2];
      places.push(cos * x - sin * z, sin * x + cos * z);
      facings.push(Math.sin(angle), Math.cos(angle));
    }
    const soon = (horizon * 2) / 3;
    const speed = lengthOf(
      toX + damped(offX, rateX, slow, soon)[0],
      toZ + damped(offZ, rateZ, slow, soon)[0],
    );
    return [...places, ...facings, speed / (speed + half_speed)];
  }

  /** How a figure is: the features after those of the trajectory, scaled. */
  now({ row, mirror }: Playback): number[] {
    const value = (i: number) =>
      this.features[row * MATCHING.FEATURES + (mirror ? COLUMNS[i]! : i)]! * (mirror ? SIGNS[i]! : 1);
    return Array.from(
      { length: MATCHING.FEATURES - MATCHING.TRAJECTORY },
      (_, i) => value(MATCHING.TRAJECTORY + i) / MATCHING.STEPS,
    );
  }

  /** Features after those of the trajectory, as the table has them. */
  scaled(features: number[]): number[] {
    const { feature_mean: mean, feature_scale: scale } = this.tables;
    return features.map(
      (value, i) => (value - mean[MATCHING.TRAJECTORY + i]!) * scale[MATCHING.TRAJECTORY + i]!,
    );
  }

  /** Let a figure go on from the row that fits best after being so, features after those of the trajectory, scaled. */
  follow(figure: Playback, target: Target, gait: number, now: number[]): void {
    now.forEach((value, i) => (this.query[MATCHING.TRAJECTORY + i] = stepsOf(value)));
    this.lead(figure, target, this.creeping(target, gait));
    const { row, mirror } = this.goals[gait]!.nearest(this.query, this.image, Infinity)!;
    Object.assign(figure, { row, part: 0, mirror, rate: 1, warp: 0, warpRate: 0, stride: 1, strideRate: 0 });
    figure.offset.fill(0);
    figure.offsetRate.fill(0);
  }

  /** Go on from another row; what the pose loses by it goes into the inertialization offset. */
  private jump(figure: Playback, row: number, mirror: boolean): void {
    const add = (sign: number) => {
      const at = figure.row * this.codes;
      const { codes } = this.tables;
      for (let k = 0; k < this.codes; k++) {
        const side = figure.mirror ? sign * this.codeSigns[k]! : sign;
        const change = codes[at + k + this.codes]! - codes[at + k]!;
        figure.offset[k]! += side * (codes[at + k]! + figure.part * change);
        figure.offsetRate[k]! += side * change * this.fps;
      }
    };
    add(1);
    Object.assign(figure, { row, part: 0, mirror });
    add(-1);
  }

  /** The codes that are played, and their offset. */
  played({ row, part, mirror, offset }: Playback, into: Float64Array): void {
    const { codes } = this.tables;
    for (let k = 0, at = row * this.codes; k < this.codes; k++, at++) {
      const value = codes[at]! + part * (codes[at + this.codes]! - codes[at]!);
      into[k] = (mirror ? this.codeSigns[k]! * value : value) + offset[k]!;
    }
  }
}

/** A scaled feature in steps. */
function stepsOf(value: number): number {
  return Math.round(MATCHING.STEPS * clamp(Math.fround(value), -LARGEST, LARGEST));
}
