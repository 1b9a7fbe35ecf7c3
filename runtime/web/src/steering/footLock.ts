/* A foot lock for live figures, standing feet stay in place without look-ahead: docs/reference/bundle.md, "The foot lock". */
import { type footLockSettings, STEPPING } from "../generated.js";
import { LEG, SOLES } from "../figures/humanoid/bones.js";
import { legOf, type Limb, reach } from "../figures/legs.js";
import { about, minus, plus, product, rotated, type Vector, Y } from "../motion/rotations.js";
import { damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";
import { type Footing, liftOf, newStep, type Plan, type Step, stepped } from "./stepping.js";

/** Points of a sole, heel, ball and tip, and which joint of a leg carries each. */
const POINTS = LEG.flatMap((part, joint) =>
  (SOLES[part] ?? []).map((point): [number, Vector] => [joint, point]),
);
const BALL = 1;

/** Of one foot, how high it steps and how fast that changes, and where the points of its sole were. */
interface Foot extends Step {
  height: [off: number, rate: number];
  soles: Vector[] | null;
}

/** The lock of one figure: a foot each, left and right. */
export type Lock = [Foot, Foot];

type LockSettings = Settings<typeof footLockSettings>;

export function newLock(): Lock {
  const foot = (): Foot => ({ ...newStep(), height: [0, 0], soles: null });
  return [foot(), foot()];
}

/** The next pose, a tick later, with standing feet held in place and above the ground. plan: of its steps, null for none. */
export function held(
  lock: Lock,
  pose: Played,
  settings: LockSettings,
  dt: number,
  plan: Plan | null,
): Played {
  const [x, z, facing] = pose.ground;
  const hips = product(about(Y, facing), pose.rotations[0]!);
  const rotations = [...pose.rotations];
  const footings = lock.map(({ shift, clock }, side): Footing => {
    const stands = pose.contacts[side]! > settings.stands;
    return { distance: Math.hypot(...shift), clock, stands, isLeft: side === 0 };
  });
  lock.forEach((foot, side) => {
    // where the leg and the points of its sole are played
    const leg = legOf(pose.rotations, side, hips, [x, pose.height, z]);
    const soles = solePoints(leg);
    const lowest = soles.reduce((least, point, at) => (point[1] < soles[least]![1] ? at : least), 0);
    // the point that bears the foot: the ball, or heel or tip if they are lower
    const bears = soles[lowest]![1] < soles[BALL]![1] - settings.bears ? lowest : BALL;
    const move = minus(soles[bears]!, (foot.soles ?? soles)[bears]!);
    foot.soles = soles;
    // the shift that keeps it where it was, or that fades once the foot swings; or a planned step
    const isHigh = pose.height > settings.low;
    const planned = isHigh && plan ? plan : null;
    const contact = isHigh ? pose.contacts[side]! : 0;
    const rises =
      planned && foot.clock >= 0
        ? byPlan(foot, footings[side]!, footings[1 - side]!, move, planned, soles[lowest]![1], settings, dt)
        : free(foot, contact, move, !!planned, soles[lowest]![1], settings, dt);
    if (foot.shift[0] || foot.shift[1] || rises)
      reach(rotations, side, hips, leg, [foot.shift[0], rises, foot.shift[1]]);
  });
  const contacts = plan ? shownContacts(lock, pose, plan) : pose.contacts;
  return { ...pose, rotations, contacts };
}

/** Where heel, ball and tip of a leg's sole are. */
export function solePoints({ turned, places }: Limb): Vector[] {
  return POINTS.map(([joint, point]) => plus(places[joint]!, rotated(turned[joint]!, point)));
}

/** Contacts as they are shown: a planned foot stands unless it is lifted. */
function shownContacts(lock: Lock, { contacts }: Played, { settings }: Plan): [number, number] {
  const [left, right] = lock.map(({ clock, height }, side) =>
    clock === STEPPING.FREE ? contacts[side]! : Math.fround(1 - Math.min(height[0] / settings.lowest, 1)),
  );
  return [left!, right!];
}

/** Move a planned foot; by how much its ankle is lifted. lowest: the height of its sole as played. */
function byPlan(
  foot: Foot,
  footing: Footing,
  other: Footing,
  [x, , z]: Vector,
  plan: Plan,
  lowest: number,
  settings: LockSettings,
  dt: number,
): number {
  const step = stepped(foot, footing, other, [x, z], plan, dt);
  Object.assign(foot, step);
  const goal = liftOf(step, plan);
  rise(foot, goal, settings, dt);
  // it comes down from where its recording has it
  if (step.clock > 0) foot.height[0] = Math.max(foot.height[0], lowest);
  return foot.height[0] - lowest;
}

/** Move a foot that is held while it stands; by how much its ankle is lifted. planned: whether it steps by plan once it stands. */
function free(
  foot: Foot,
  contact: number,
  move: Vector,
  planned: boolean,
  lowest: number,
  settings: LockSettings,
  dt: number,
): number {
  const { stands, moved } = shift(foot, move, contact > settings.stands, settings, dt);
  foot.anchor = [0, 0];
  foot.clock = planned && stands ? 0 : STEPPING.FREE;
  // lift a foot that is moved back while its contact still is high, and any out of the ground
  const steps = contact * settings.steps * Math.min(1, moved / (settings.swings * dt));
  rise(foot, steps, settings, dt);
  if (foot.clock === 0) foot.height[0] = Math.max(foot.height[0], lowest);
  const lift = foot.height[0] - lowest;
  return foot.clock === 0 ? lift : Math.max(0, lift);
}

/** Lift a foot softly. */
function rise(foot: Foot, goal: number, settings: LockSettings, dt: number): void {
  const [off, rate] = damped(foot.height[0] - goal, foot.height[1], dampingOf(settings.lifts), dt);
  foot.height = [goal + off, rate];
}

/** Move a foot whose point that bears it was moved since the last tick; whether it stands, and how far it is then shown to move. */
function shift(
  foot: Foot,
  [x, , z]: Vector,
  contact: boolean,
  settings: LockSettings,
  dt: number,
): { stands: boolean; moved: number } {
  const stay: [number, number] = [foot.shift[0] - x, foot.shift[1] - z];
  if (contact && Math.hypot(x, z) < settings.swings * dt && Math.hypot(...stay) < settings.farthest) {
    foot.shift = stay;
    foot.drift = [0, 0];
    return { stands: true, moved: 0 };
  }
  const damping = dampingOf(settings.fade);
  const [offX, rateX] = damped(foot.shift[0], foot.drift[0], damping, dt);
  const [offZ, rateZ] = damped(foot.shift[1], foot.drift[1], damping, dt);
  foot.shift = [offX, offZ];
  foot.drift = [rateX, rateZ];
  return { stands: false, moved: Math.hypot(offX - stay[0], offZ - stay[1]) };
}
