/* The tuned numbers of a feature, which a bundle's `settings` hold: the usual ones and their ranges are Python's. */
import { BundleError } from "./errors.js";

export interface Range {
  /** null where a bundle has to say it. */
  readonly default: number | null;
  readonly low: number;
  readonly high: number;
  readonly whole: boolean;
}

/** The ranges of a feature's settings; in declarations only their names are written. */
export const ranges = <Name extends string>(values: Record<Name, Range>): Record<Name, Range> => values;

/** A number for each setting of a feature. */
export type Settings<Ranges> = Record<keyof Ranges, number>;

/** Whether a number is within a range, and whole where it has to be. */
export function fits(value: number, { low, high, whole }: Range): boolean {
  return value >= low && value <= high && (!whole || Number.isInteger(value));
}

/** The settings of a feature, the usual ones where a bundle does not say them; BundleError names one that is unknown or out of range. */
export function settingsOf<Ranges extends Record<string, Range>>(
  feature: string,
  ranges: Ranges,
  values: Record<string, number> = {},
): Settings<Ranges> {
  const unknown = Object.keys(values).filter((name) => !Object.hasOwn(ranges, name));
  if (unknown.length)
    throw new BundleError(`manifest, settings.${feature}: ${unknown.join(", ")} is unknown`);
  const settings: Record<string, number> = {};
  for (const [name, range] of Object.entries(ranges)) {
    const value = values[name] ?? range.default;
    if (value === null || !fits(value, range)) {
      throw new BundleError(
        `manifest, settings.${feature}.${name}: must be ${range.low} to ${range.high}, not ${value}`,
      );
    }
    settings[name] = value;
  }
  return settings as Settings<Ranges>;
}
