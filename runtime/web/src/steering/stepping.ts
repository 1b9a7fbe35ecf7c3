/* Steps that are planned, of figures that go slowly, turn on the spot or have just stopped, as motet/steering/stepping.py says. */
import { STEPPING, type stepSettings } from "../generated.js";
import { lengthOf } from "../motion/planar.js";
import type { Matcher, Playback, Target } from "./matching.js";
import type { Settings } from "../settings.js";

/** What is planned for a figure in a tick. */
export interface Plan {
  settings: Settings<typeof stepSettings>;
  /** Whether it has come to rest. */
  settled: boolean;
}

/** A foot: offsets along x and z from where it is played to where it is shown. */
export interface Step {
  shift: [number, number];
  /** The mean of how fast the offset changes while the foot stands, m/s. */
  drift: [number, number];
  /** The offset that would bring it to where it stood last. */
  anchor: [number, number];
  /** Seconds since it was lifted, 0 while it stands, FREE while it is not planned. */
  clock: number;
}

/** What decides whether a foot is lifted: as it was a tick ago, but for its contact. */
export interface Footing {
  distance: number;
  clock: number;
  stands: boolean;
  isLeft: boolean;
}

export function newStep(): Step {
  return { shift: [0, 0], drift: [0, 0], anchor: [0, 0], clock: STEPPING.FREE };
}

/** The plan of a figure, null for none. share: of its rest. */
export function planOf(
  matcher: Matcher,
  figure: Playback,
  target: Target,
  gait: number,
  share: number,
  settings: Settings<typeof stepSettings>,
): Plan | null {
  const pace = lengthOf(figure.spring[0], figure.spring[1]);
  const creeps = matcher.creeping(target, gait) && pace < matcher.settings.creep;
  const stops = matcher.resting(figure, target, gait);
  return creeps || stops ? { settings, settled: stops && share > settings.rests } : null;
}

/** A planned foot a tick later. move: how far the pose has moved it since the last tick. */
export function stepped(
  before: Step,
  footing: Footing,
  other: Footing,
  move: [number, number],
  plan: Plan,
  seconds: number,
): Step {
  const { settings, settled } = plan;
  // the offset that keeps it where it stood
  const swung = before.clock > 0;
  const from = swung ? before.anchor : before.shift;
  const anchor: [number, number] = [from[0] - move[0], from[1] - move[1]];
  // it is lifted, and while it swings it is led to its goal
  const lifts = swung || isLifted(footing, other, plan);
  const clock = lifts ? before.clock + seconds : before.clock;
  const goal = goalOf(before, plan);
  const share = lifts ? eased(Math.min(clock / settings.swing, 1)) : 0;
  const shift: [number, number] = [
    anchor[0] + share * (goal[0] - anchor[0]),
    anchor[1] + share * (goal[1] - anchor[1]),
  ];
  // it comes down where its recording stands
  const lands = clock >= settings.swing && (footing.stands || settled);
  // while it stands, its drift is averaged
  const kept = lifts ? 1 : 0.5 ** (seconds / settings.mean);
  const drift: [number, number] = [
    kept * before.drift[0] - ((1 - kept) * move[0]) / seconds,
    kept * before.drift[1] - ((1 - kept) * move[1]) / seconds,
  ];
  return { shift, drift, anchor, clock: lands ? 0 : clock };
}

/** How high a planned foot is to be above the ground. */
export function liftOf(step: Step, plan: Plan): number {
  if (step.clock <= 0) return 0;
  const { lowest, highest, longest } = plan.settings;
  const goal = goalOf(step, plan);
  const distance = lengthOf(step.anchor[0] - goal[0], step.anchor[1] - goal[1]);
  return lowest + Math.min(distance / longest, 1) * (highest - lowest);
}

/** Whether a foot that stands is lifted: its recording swings it, or it is too far from where the pose wants it. */
function isLifted(footing: Footing, other: Footing, { settings, settled }: Plan): boolean {
  if (footing.clock !== 0 || other.clock > 0) return false;
  if (footing.stands !== other.stands) return other.stands;
  const isFarther =
    footing.distance > other.distance || (footing.distance === other.distance && footing.isLeft);
  return isFarther && footing.distance > (settled ? settings.settles : settings.stray);
}

/** The offset that a foot is led to: ahead, against its drift. */
function goalOf({ drift }: Step, { settings, settled }: Plan): [number, number] {
  if (settled) return [0, 0];
  const length = lengthOf(drift[0], drift[1]) * settings.leads;
  const ahead = -settings.leads * Math.min(settings.lead / Math.max(length, settings.lead), 1);
  return [ahead * drift[0], ahead * drift[1]];
}

/** From 0 to 1, with neither speed nor acceleration at either end. */
function eased(share: number): number {
  return share * share * share * (10 + share * (6 * share - 15));
}
