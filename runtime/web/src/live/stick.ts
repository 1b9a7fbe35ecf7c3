/* One curve for every stick: from how far it is pushed to a gait and its speed. */

/** A stick that is pushed less asks for nothing. */
export const DEAD = 0.15;
/** Pushed so far, a figure goes at its usual walk; all the way, at its usual run. */
const WALKS = 0.7;
/** m/s from which a walk becomes a run, and below which a run becomes a walk. */
const RUNS = 1.95;
const RESTS = 1.6;

/** m/s: the slowest and the usual walk, and the usual run. */
export interface Paces {
  least: number;
  walk: number;
  run: number;
}

/** The speed in m/s, 0 to the usual run, of a stick pushed so far, 0 to 1; and whether it is a run, of a figure that runs or does not. */
export function stick(
  push: number,
  runs: boolean,
  { least, walk, run }: Paces,
): { speed: number; runs: boolean } {
  if (!(push >= DEAD)) return { speed: 0, runs: false };
  const [from, to, start, end] = push < WALKS ? [least, walk, DEAD, WALKS] : [walk, run, WALKS, 1];
  const speed = from + ((to - from) * (Math.min(push, 1) - start)) / (end - start);
  return { speed, runs: speed > (runs ? RESTS : RUNS) };
}
