/* The tuned numbers of the loop `matching`, which a bundle's `settings` hold. */
import { BundleError } from "./errors.js";

type Range = readonly [usual: number, least: number, most: number];

const RADIANS = [0, 3.15] as const;
const HALF_LIFE = [0.01, 10] as const;

const STEERING = {
  velocity: [0.22, ...HALF_LIFE],
  facing: [0.18, ...HALF_LIFE],
  horizon: [1, 0.1, 10],
  half_speed: [0.7, 0.01, 100],
  search_every: [6, 1, 60],
  lag: [50, 0, 1e6],
  lasting: [20, 0, 10_000],
  jump_back: [20, 0, 10_000],
  jump_ahead: [5, 0, 10_000],
  continuing: [2, 0, 1e6],
  prepares: [9, 0, 10_000],
  row_step: [2, 1, 100],
  stands: [0.1, 0, 1],
  blend: [0.13, ...HALF_LIFE],
  slowest: [0.8, 0.1, 1],
  fastest: [1.15, 1, 10],
  shortest: [0.8, 0.1, 1],
  longest: [1.25, 1, 10],
  idle: [0.4, 0.01, 100],
  creep: [0.67, 0.01, 100],
  creep_slowest: [0.5, 0.1, 1],
  turn: [0.15, ...HALF_LIFE],
  turn_still: [0.1, 0, 100],
  turn_moving: [1, 0, 100],
  turn_speed: [1.5, 0, 100],
  turn_turning: [0.5, 0, 100],
  warp: [1, ...RADIANS],
  veer: [0.35, ...RADIANS],
  veer_within: [0.4, 0, 100],
  aside: [Math.PI / 3, ...RADIANS],
  back: [(2 * Math.PI) / 3, ...RADIANS],
  ahead: [Math.PI / 6, ...RADIANS],
} as const satisfies Record<string, Range>;

const LOCK = {
  fade: [0.1, 0.001, 10],
  farthest: [0.2, 0, 1],
  swings: [1, 0.01, 100],
  stands: [0.5, 0, 1],
  bears: [0.02, 0, 1],
  steps: [0.08, 0, 1],
} as const satisfies Record<string, Range>;

const ACTS = { blend: [0.12, ...HALF_LIFE], far: [0.7, 0.01, 3.15], entry: [0.5, 0, 10], rest: [0.25, 0, 100] } as const satisfies Record<string, Range>;

const WHOLE = ["search_every", "lasting", "jump_back", "jump_ahead", "prepares", "row_step"];

export type Steering = Record<keyof typeof STEERING, number>;
export type LockSettings = Record<keyof typeof LOCK, number>;
export type ActSettings = Record<keyof typeof ACTS, number>;
export type Settings = Record<string, Record<string, number> | undefined>;

/** Those of `settings.steering`; a missing number is the usual one, BundleError names one that is unknown or out of range. */
export function steeringOf(settings: Settings): Steering {
  return read("steering", STEERING, settings.steering ?? {}) as Steering;
}

/** The same of `settings.foot_lock`. */
export function lockOf(settings: Settings): LockSettings {
  return read("foot_lock", LOCK, settings.foot_lock ?? {}) as LockSettings;
}

/** The same of `settings.acting`. */
export function actsOf(settings: Settings): ActSettings {
  return read("acting", ACTS, settings.acting ?? {}) as ActSettings;
}

function read(feature: string, ranges: Record<string, Range>, given: Record<string, number>): Record<string, number> {
  const unknown = Object.keys(given).filter((name) => !Object.hasOwn(ranges, name));
  if (unknown.length) throw new BundleError(`manifest, settings.${feature}: ${unknown.join(", ")} is unknown`);
  const found = Object.entries(ranges).map(([name, [usual, least, most]]): [string, number] => {
    const value = given[name] ?? usual;
    if (!(value >= least && value <= most) || (WHOLE.includes(name) && !Number.isInteger(value))) {
      throw new BundleError(`manifest, settings.${feature}.${name}: must be ${least} to ${most}, not ${value}`);
    }
    return [name, value];
  });
  return Object.fromEntries(found);
}
