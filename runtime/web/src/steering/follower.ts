/* Values that follow others: small steps at once, and leaps smoothly, by a spring. */
import { damped, dampingOf } from "../motion/springs.js";

/** Of one figure. wanted: what is followed; off, rate: how far from it it is shown, and how fast that changes, a second. */
export interface Follower {
  wanted: number[];
  off: number[];
  rate: number[];
}

/** One that is where it should be. */
export function followerAt(values: number[]): Follower {
  const still = values.map(() => 0);
  return { wanted: values, off: still, rate: still };
}

/** Where it is. */
export function shownBy({ wanted, off }: Follower): number[] {
  return wanted.map((value, i) => value + off[i]!);
}

/** A tick later: what moves farther than `leap` in a tick is caught up with. */
export function followed(
  before: Follower,
  wanted: number[],
  leap: number,
  halfLife: number,
  seconds: number,
): Follower {
  const moved = wanted.map((value, i) => value - before.wanted[i]!);
  const leaps = Math.sqrt(moved.reduce((sum, value) => sum + value * value, 0)) > leap;
  const later = before.off.map((off, i) =>
    damped(leaps ? off - moved[i]! : off, before.rate[i]!, dampingOf(halfLife), seconds),
  );
  return { wanted, off: later.map(([off]) => off), rate: later.map(([, rate]) => rate) };
}
