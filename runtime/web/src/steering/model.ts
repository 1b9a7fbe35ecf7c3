/* Figures that are steered by motion matching; no ONNX Runtime is needed. */
import {
  CONTROL,
  FIELDS,
  MATCHING,
  STEERING,
  actSettings,
  arrivalSettings,
  avoidanceSettings,
  footLockSettings,
  idleSettings,
  lookSettings,
  reachSettings,
  steeringSettings,
  stepSettings,
  styleSettings,
  terrainSettings,
  turnSettings,
} from "../generated.js";
import { type Act, actOf, reachOf } from "./acts.js";
import type { Bundle, Manifest } from "../bundle/bundle.js";
import { ControlSession, type Rows } from "./session.js";
import { BundleError, ControlError } from "../errors.js";
import { Gaits, type Speeds } from "./gaits.js";
import { BONES } from "../figures/humanoid/bones.js";
import { Matcher, type Tables } from "./matching.js";
import { Model } from "../models/base.js";
import { Steerer } from "./step.js";
import { STYLE_NAMES } from "./styleLayer.js";

export interface StartSettings {
  /** By default the first. */
  gait?: string;
  characters?: number;
  /** x and z in metres and facing in degrees, for all or for each; by default the origin, facing z. */
  places?: Rows;
  /** Keep planted feet in place, by turning hips and knees. */
  holdFeet?: boolean;
  /** Refuse a speed outside a gait's range, instead of clamping it. */
  strict?: boolean;
  /** Ticks until the first search, below `search_every`: from then on each searches in its turn alone, and what it is told
   *  waits for that. By default those of 32 figures or more are 0, 1, 2 and so on in turn: every tick costs the same. */
  phases?: number | readonly number[];
}

/** A figure that goes where it is told, in several gaits. */
export class ControlModel extends Model {
  readonly gaits: readonly string[];
  /** The styles in which figures go, and "none". */
  readonly styles = STYLE_NAMES;
  readonly abilities: Gaits;
  readonly steerer: Steerer;
  readonly lock = this.tuned("foot_lock", footLockSettings);
  readonly steps = this.tuned("stepping", stepSettings);
  readonly acts = this.tuned("acting", actSettings);
  readonly styling = this.tuned("style", styleSettings);
  readonly idle = this.tuned("idle", idleSettings);
  readonly look = this.tuned("look", lookSettings);
  readonly reach = this.tuned("reach", reachSettings);
  readonly terrain = this.tuned("terrain", terrainSettings);
  readonly turns = this.tuned("turns", turnSettings);
  readonly arrival = this.tuned("arrival", arrivalSettings);
  readonly avoidance = this.tuned("avoidance", avoidanceSettings);
  private taken?: ReadonlyMap<string, readonly Act[]>;

  constructor(manifest: Manifest, tables: Tables) {
    super(manifest);
    const steering = this.tuned("steering", steeringSettings);
    const { names, speeds, odd } = configOf(manifest, tables.codes.length / tables.left.length);
    this.abilities = new Gaits(names, speeds, steering);
    this.gaits = names;
    const matcher = new Matcher(tables, odd, names.length, steering, this.fps);
    matcher.goals.forEach((goals, gait) => {
      if (!goals.rows.length)
        throw new BundleError(`table left: no row of ${JSON.stringify(names[gait])} can be jumped to`);
    });
    this.steerer = new Steerer(matcher);
  }

  /** Of each gait the slowest and the fastest speed forward and the usual one, m/s. */
  get speeds(): Record<string, { slowest: number; usual: number; fastest: number }> {
    const of = (gait: number) => {
      const [slowest, usual, fastest] = this.abilities.speeds[gait]!;
      return { slowest, usual, fastest };
    };
    return Object.fromEntries(this.gaits.map((name, gait) => [name, of(gait)]));
  }

  /** The recordings of gaits that go nowhere, such as "jump", as acts, by the gait's name. */
  get takes(): ReadonlyMap<string, readonly Act[]> {
    return (this.taken ??= takesOf(this));
  }

  /** The take of a gait that goes nowhere that leads the farthest for a figure that moves, and the least far for others. */
  take(name: string, moves: boolean): Act {
    const acts = this.takes.get(name);
    if (!acts)
      throw new ControlError(
        `no act ${JSON.stringify(name)}; expected a motion, or one of ${[...this.takes.keys()].join(", ")}`,
      );
    return [...acts].sort((a, b) => reachOf(a) - reachOf(b)).at(moves ? -1 : 0)!;
  }

  /** A session of figures that stand still. ControlError for what is out of range. */
  start({
    gait = this.gaits[0]!,
    characters = 1,
    places,
    holdFeet = true,
    strict = false,
    phases,
  }: StartSettings = {}): ControlSession {
    if (!Number.isInteger(characters) || characters < 1 || characters > CONTROL.LARGEST_CROWD) {
      throw new ControlError(
        `characters must be a whole number from 1 to ${CONTROL.LARGEST_CROWD}, not ${characters}`,
      );
    }
    const number = this.abilities.number(gait);
    const turns = this.phases(characters, phases);
    const session = new ControlSession(this, number, characters, holdFeet, strict, turns);
    if (places !== undefined) session.put(places);
    return session;
  }

  /** The phase of each figure; null for those that search after every command. */
  phases(characters: number, phases?: number | readonly number[]): number[] | null {
    const every = this.steerer.matcher.settings.search_every;
    if (phases === undefined && characters < STEERING.SPREAD_FROM) return null;
    const all = Array.from({ length: characters }, (_, at) =>
      phases === undefined ? at % every : Array.isArray(phases) ? (phases[at] as number) : (phases as number),
    );
    const fits =
      (!Array.isArray(phases) || phases.length === characters) &&
      all.every((phase) => Number.isInteger(phase) && phase >= 0 && phase < every);
    if (!fits)
      throw new ControlError(
        `phases must be whole numbers from 0 to ${every - 1}, for all or for each of ${characters}`,
      );
    return all;
  }
}

function takesOf(model: ControlModel): Map<string, Act[]> {
  const { steerer, gaits, abilities } = model;
  const { left } = steerer.matcher.tables;
  const nowhere = [...gaits.keys()].filter((gait) => !abilities.speeds[gait]![1]);
  const rows = (gait: number) => [...left.keys()].filter((row) => steerer.matcher.shows(row, gait));
  const begins = (all: number[]) => all.filter((_, at) => !at || !left[all[at - 1]!]);
  const take = (name: string, first: number) => actOf(model, name, steerer.recorded(first, left[first]! + 1));
  return new Map(
    nowhere.map((gait) => [gaits[gait]!, begins(rows(gait)).map((first) => take(gaits[gait]!, first))]),
  );
}

function configOf(
  { config, motion: { channels } }: Manifest,
  codes: number,
): { names: string[]; speeds: Speeds[]; odd: number } {
  const names = config.gaits as string[];
  const speeds = config.speeds as Speeds[];
  const odd = config.odd as number;
  if (!Array.isArray(names) || !names.length || !names.every((name) => typeof name === "string")) {
    throw new BundleError("manifest, config.gaits: must be names");
  }
  const within = (row: unknown) =>
    Array.isArray(row) && row.length === 5 && row.every((speed) => speed >= 0 && speed <= 100);
  if (!Array.isArray(speeds) || speeds.length !== names.length || !speeds.every(within)) {
    throw new BundleError(
      "manifest, config.speeds: must hold a row of 5 speeds, 0 to 100 m/s, for each gait",
    );
  }
  if (!speeds.every(([slowest, usual, forward]) => slowest <= usual && usual <= forward)) {
    throw new BundleError(
      "manifest, config.speeds: must rise from the slowest to the usual and the fastest forward",
    );
  }
  if (!(Number.isInteger(odd) && odd >= 0 && odd <= codes))
    throw new BundleError(`manifest, config.odd: must be 0 to ${codes}`);
  const bones = channels.filter((name) => name.endsWith(".xx")).map((name) => name.slice(0, -3));
  if (`${bones}` !== `${BONES}`)
    throw new BundleError("manifest, motion.channels: must be those of the humanoid, in its order");
  return { names, speeds, odd };
}

/** The model of a bundle, whose tables are checked: docs/reference/bundle.md, the loop `matching`. */
export async function controlModel(bundle: Bundle): Promise<ControlModel> {
  return new ControlModel(bundle.manifest, await tablesOf(bundle));
}

async function tablesOf(bundle: Bundle): Promise<Tables> {
  const [rows, codes] = bundle.manifest.tables?.codes?.shape ?? [];
  const gaits = (bundle.manifest.config?.gaits as string[] | undefined)?.length;
  const values = 4 * BONES.length + 1;
  const table = async (
    name: string,
    dtype: string,
    shape: (number | undefined)[],
    least = -FIELDS.LARGEST_NUMBER,
    most: (at: number) => number = () => FIELDS.LARGEST_NUMBER,
  ) => {
    const entry = bundle.manifest.tables?.[name];
    if (entry && (entry.dtype !== dtype || `${entry.shape}` !== `${shape}`)) {
      throw new BundleError(`table ${name} is ${entry.dtype} (${entry.shape}), not ${dtype} (${shape})`);
    }
    const { data } = await bundle.table(name);
    if (!data.every((value, at) => value >= least && value <= most(at))) {
      throw new BundleError(`table ${name}: holds a number that is out of range`);
    }
    return data;
  };
  return {
    codes: (await table("codes", "float16", [rows, codes])) as Float32Array,
    moves: (await table("moves", "float32", [rows, 6])) as Float32Array,
    features: (await table("features", "int8", [rows, MATCHING.FEATURES])) as Int8Array,
    shows: (await table("shows", "uint8", [rows, gaits], 0, () => 1)) as Uint8Array,
    left: (await table("left", "int32", [rows], 0, (at) => rows! - 1 - at)) as Int32Array,
    feature_mean: (await table("feature_mean", "float32", [MATCHING.FEATURES])) as Float32Array,
    feature_scale: (await table("feature_scale", "float32", [MATCHING.FEATURES], 1e-6)) as Float32Array,
    pose_mean: (await table("pose_mean", "float32", [values])) as Float32Array,
    pose_basis: (await table("pose_basis", "float16", [codes, values])) as Float32Array,
  };
}
