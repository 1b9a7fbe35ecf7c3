/* A foot lock for live figures, standing feet stay in place without look-ahead: docs/reference/bundle.md, "The foot lock". */
import type { footLockSettings } from "../generated.js";
import { LEG, SOLES } from "../figures/humanoid/bones.js";
import { legOf, type Limb, reach } from "../figures/legs.js";
import { about, minus, plus, product, rotated, type Vector, Y } from "../motion/rotations.js";
import { damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";

/** Points of a sole, heel, ball and tip, and which joint of a leg carries each. */
const POINTS = LEG.flatMap((part, joint) =>
  (SOLES[part] ?? []).map((point): [number, Vector] => [joint, point]),
);
const BALL = 1;

/** Of one foot: by how much it is moved along x and z and how high it steps, how fast these change, and where the points of its
 *  sole were. */
interface Foot {
  shift: [number, number];
  drift: [number, number];
  height: [off: number, rate: number];
  soles: Vector[] | null;
}

/** The lock of one figure: a foot each, left and right. */
export type Lock = [Foot, Foot];

export function newLock(): Lock {
  const foot = (): Foot => ({ shift: [0, 0], drift: [0, 0], height: [0, 0], soles: null });
  return [foot(), foot()];
}

/** The next pose, a tick later, with standing feet held in place and above the ground. */
export function held(
  lock: Lock,
  pose: Played,
  settings: Settings<typeof footLockSettings>,
  dt: number,
): Played {
  const [x, z, facing] = pose.ground;
  const hips = product(about(Y, facing), pose.rotations[0]!);
  const rotations = [...pose.rotations];
  lock.forEach((foot, side) => {
    // where the leg and the points of its sole are played
    const leg = legOf(pose.rotations, side, hips, [x, pose.height, z]);
    const soles = solePoints(leg);
    const lowest = soles.reduce((least, point, at) => (point[1] < soles[least]![1] ? at : least), 0);
    // the point that bears the foot: the ball, or heel or tip if they are lower
    const bears = soles[lowest]![1] < soles[BALL]![1] - settings.bears ? lowest : BALL;
    // the shift that keeps it where it was, or that fades once the foot swings
    const contact = pose.height > settings.low ? pose.contacts[side]! : 0;
    const moved = shift(
      foot,
      minus(soles[bears]!, (foot.soles ?? soles)[bears]!),
      contact > settings.stands,
      settings,
      dt,
    );
    foot.soles = soles;
    // lift a foot that is moved back while its contact still is high, and any out of the ground
    const steps = contact * settings.steps * Math.min(1, moved / (settings.swings * dt));
    const [off, rise] = damped(foot.height[0] - steps, foot.height[1], dampingOf(settings.lifts), dt);
    foot.height = [steps + off, rise];
    const lift = Math.max(0, steps + off - soles[lowest]![1]);
    if (foot.shift[0] || foot.shift[1] || lift)
      reach(rotations, side, hips, leg, [foot.shift[0], lift, foot.shift[1]]);
  });
  return { ...pose, rotations };
}

/** Where heel, ball and tip of a leg's sole are. */
export function solePoints({ turned, places }: Limb): Vector[] {
  return POINTS.map(([joint, point]) => plus(places[joint]!, rotated(turned[joint]!, point)));
}

/** Move a foot whose point that bears it was moved since the last tick; how far that is then shown to move. */
function shift(
  foot: Foot,
  [x, , z]: Vector,
  contact: boolean,
  settings: Settings<typeof footLockSettings>,
  dt: number,
): number {
  const stay: [number, number] = [foot.shift[0] - x, foot.shift[1] - z];
  if (contact && Math.hypot(x, z) < settings.swings * dt && Math.hypot(...stay) < settings.farthest) {
    foot.shift = stay;
    foot.drift = [0, 0];
    return 0;
  }
  const damping = dampingOf(settings.fade);
  const [offX, rateX] = damped(foot.shift[0], foot.drift[0], damping, dt);
  const [offZ, rateZ] = damped(foot.shift[1], foot.drift[1], damping, dt);
  foot.shift = [offX, offZ];
  foot.drift = [rateX, rateZ];
  return Math.hypot(offX - stay[0], offZ - stay[1]);
}
