/* A foot lock for live figures, standing feet stay in place without look-ahead: docs/reference/bundle.md, "The foot lock". */
import { type footLockSettings, STEPPING } from "../generated.js";
import { lengthOf } from "../motion/planar.js";
import { LEG, LEG_LENGTH, SOLES } from "../figures/humanoid/bones.js";
import { legOf, type Limb, reach } from "../figures/legs.js";
import { about, minus, plus, product, rotated, size, turnAt, type Vector, Y } from "../motion/rotations.js";
import { damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";
import { type Footing, liftOf, newStep, type Plan, type Step, stepped } from "./stepping.js";

/** Points of a sole, heel, ball and tip, and which joint of a leg carries each. */
const POINTS = LEG.flatMap((part, joint) =>
  (SOLES[part] ?? []).map((point): [number, Vector] => [joint, point]),
);
const BALL = 1;

/** Of one foot, how high it steps and how fast that changes, where the points of its sole were, if there was a tick. */
interface Foot extends Step {
  height: [off: number, rate: number];
  /** Whether it was released before its contact ended. */
  released: boolean;
  soles: Float64Array;
  isNew: boolean;
}

/** The lock of one figure: a foot each, left and right. */
export type Lock = [Foot, Foot];

type LockSettings = Settings<typeof footLockSettings>;

export function newLock(): Lock {
  const foot = (): Foot => ({
    ...newStep(),
    height: [0, 0],
    released: false,
    soles: new Float64Array(3 * POINTS.length),
    isNew: true,
  });
  return [foot(), foot()];
}

/** Hold standing feet of a pose in place and above the ground, a tick later. plan: of its steps, null for none. */
export function held(lock: Lock, pose: Played, settings: LockSettings, dt: number, plan: Plan | null): void {
  const { ground, rotations } = pose;
  const hips = product(about(Y, ground[2]), turnAt(rotations, 0));
  const place: Vector = [ground[0], pose.height, ground[1]];
  const footings = [footingOf(lock, 0, pose, settings), footingOf(lock, 1, pose, settings)];
  for (let side = 0; side < 2; side++) {
    const foot = lock[side]!;
    // where the leg and the points of its sole are played
    const leg = legOf(rotations, side, hips, place);
    const soles = solePoints(leg);
    let lowest = 0;
    for (let at = 1; at < soles.length; at++) if (soles[at]![1] < soles[lowest]![1]) lowest = at;
    // the point that bears the foot: the ball, or heel or tip if they are lower
    const low = soles[lowest]![1];
    const bears = low < soles[BALL]![1] - settings.bears ? lowest : BALL;
    const move: [number, number] = [0, 0];
    if (!foot.isNew) {
      move[0] = soles[bears]![0] - foot.soles[3 * bears]!;
      move[1] = soles[bears]![2] - foot.soles[3 * bears + 2]!;
    }
    for (let point = 0, at = 0; point < soles.length; point++)
      for (let axis = 0; axis < 3; axis++, at++) foot.soles[at] = soles[point]![axis]!;
    foot.isNew = false;
    // the shift that keeps it where it was, or that fades once the foot swings; or a planned step
    const isHigh = pose.height > settings.low;
    const planned = isHigh && plan ? plan : null;
    const contact = pose.contacts[side]!;
    foot.released = isReleased(foot, contact, leg, settings);
    const rises =
      planned && foot.clock >= 0
        ? byPlan(foot, footings[side]!, footings[1 - side]!, move, planned, low, settings, dt)
        : free(foot, contact, move, isHigh, !!planned, low, settings, dt);
    if (foot.shift[0] || foot.shift[1] || rises)
      reach(rotations, side, hips, leg, [foot.shift[0], rises, foot.shift[1]]);
  }
  showContacts(lock, pose, plan);
}

function footingOf(lock: Lock, side: 0 | 1, { contacts }: Played, settings: LockSettings): Footing {
  const { shift, clock } = lock[side];
  const distance = lengthOf(shift[0], shift[1]);
  return { distance, clock, stands: contacts[side] > settings.stands, isLeft: side === 0 };
}

/** Where heel, ball and tip of a leg's sole are. */
export function solePoints({ turned, places }: Limb): Vector[] {
  return POINTS.map((point) => plus(places[point[0]]!, rotated(turned[point[0]]!, point[1])));
}

/** Contacts as they are shown: a released foot does not stand, and a planned one stands unless it is lifted. */
function showContacts(lock: Lock, { contacts }: Played, plan: Plan | null): void {
  for (let side = 0; side < 2; side++) {
    const { clock, height, released } = lock[side]!;
    if (plan && clock !== STEPPING.FREE)
      contacts[side] = Math.fround(1 - Math.min(height[0] / plan.settings.lowest, 1));
    else if (released) contacts[side] = 0;
  }
}

/** Whether a foot is released before its contact ends, as its leg does not reach where it is held. */
function isReleased(foot: Foot, contact: number, { places }: Limb, settings: LockSettings): boolean {
  if (contact <= settings.stands) return false;
  if (foot.released) return true;
  const [x, y, z] = minus(places[2], places[0]);
  return size([x + foot.shift[0], y, z + foot.shift[1]]) > settings.stretches * LEG_LENGTH;
}

/** Move a planned foot; by how much its ankle is lifted. lowest: the height of its sole as played. */
function byPlan(
  foot: Foot,
  footing: Footing,
  other: Footing,
  move: [number, number],
  plan: Plan,
  lowest: number,
  settings: LockSettings,
  dt: number,
): number {
  const step = stepped(foot, footing, other, move, plan, dt);
  Object.assign(foot, step);
  const goal = liftOf(step, plan);
  rise(foot, goal, settings, dt);
  // it comes down from where its recording has it
  if (step.clock > 0) foot.height[0] = Math.max(foot.height[0], lowest);
  return foot.height[0] - lowest;
}

/** Move a foot that is held while it stands; by how much its ankle is lifted. isHigh: whether the hips are. planned: whether it steps by plan once it stands. */
function free(
  foot: Foot,
  contact: number,
  [x, z]: [number, number],
  isHigh: boolean,
  planned: boolean,
  lowest: number,
  settings: LockSettings,
  dt: number,
): number {
  const held = isHigh && !foot.released ? contact : 0;
  const wasX = foot.shift[0] - x;
  const wasZ = foot.shift[1] - z;
  const stands = shift(foot, x, z, held > settings.stands, settings, dt);
  const moved = lengthOf(foot.shift[0] - wasX, foot.shift[1] - wasZ);
  foot.anchor[0] = 0;
  foot.anchor[1] = 0;
  foot.clock = planned && stands ? 0 : STEPPING.FREE;
  // lift a foot that is moved back while its contact still is high, or that would drag, and any out of the ground
  const share = Math.min(1, moved / (settings.swings * dt));
  const clears = held < settings.leaves && share < 1 ? settings.clears : 0;
  rise(foot, isHigh ? contact * share * settings.steps + clears : 0, settings, dt);
  if (foot.clock === 0) foot.height[0] = Math.max(foot.height[0], lowest);
  const lift = foot.height[0] - lowest;
  return foot.clock === 0 ? lift : Math.max(0, lift);
}

/** Lift a foot softly. */
function rise(foot: Foot, goal: number, settings: LockSettings, dt: number): void {
  const [off, rate] = damped(foot.height[0] - goal, foot.height[1], dampingOf(settings.lifts), dt);
  foot.height[0] = goal + off;
  foot.height[1] = rate;
}

/** Move a foot whose point that bears it was moved since the last tick; whether it stands. */
function shift(
  foot: Foot,
  x: number,
  z: number,
  contact: boolean,
  settings: LockSettings,
  dt: number,
): boolean {
  const toX = foot.shift[0] - x;
  const toZ = foot.shift[1] - z;
  if (contact && lengthOf(x, z) < settings.swings * dt && lengthOf(toX, toZ) < settings.farthest) {
    foot.shift[0] = toX;
    foot.shift[1] = toZ;
    foot.drift[0] = 0;
    foot.drift[1] = 0;
    return true;
  }
  const damping = dampingOf(settings.fade);
  const [offX, rateX] = damped(foot.shift[0], foot.drift[0], damping, dt);
  const [offZ, rateZ] = damped(foot.shift[1], foot.drift[1], damping, dt);
  foot.shift[0] = offX;
  foot.shift[1] = offZ;
  foot.drift[0] = rateX;
  foot.drift[1] = rateZ;
  return false;
}
