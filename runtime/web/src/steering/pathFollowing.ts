/* Commands of figures that are on their way to a point, and of those that keep apart, tick by tick: motet/steering/paths.py. */
import { aside, keptApart } from "./avoidance.js";
import { faces, onward, settle } from "./arrival.js";
import type { Command, Gaits } from "./gaits.js";
import type { Target } from "./matching.js";
import { hasten, type Steered, type SteeringModel } from "./steered.js";

/** Let those that are on a way go on, and those that move keep `room` metres apart, if it is not 0. */
export function lead(model: SteeringModel, figures: Steered[], room: number): void {
  const { abilities } = model;
  const before = figures.map(({ target, command }) => ({ target, gait: command.gait }));
  for (const figure of figures) {
    if (figure.going) follow(model, figure);
    figure.target = abilities.target(figure.command).target;
  }
  if (room) keepApart(model, figures, room);
  figures.forEach(({ playback, target, command }, at) => {
    const sudden = target.some((value, i) => Math.abs(value - before[at]!.target[i]!) > model.arrival.sudden);
    if (sudden || command.gait !== before[at]!.gait) hasten(playback);
  });
}

/** Command a figure to go on along its path, and move it as it comes to rest at the end. */
function follow({ abilities, steerer, arrival, fps }: SteeringModel, figure: Steered): void {
  const halfLife = steerer.matcher.settings.velocity;
  const { playback, command, going } = figure;
  const velocity = onward(going!, playback, arrival, halfLife);
  settle(going!, playback, arrival, halfLife, 1 / fps);
  const speed = Math.hypot(...velocity);
  const gait = speed > 0 ? slowed(abilities, going!.gait, speed) : command.gait;
  const direction = speed > 0 ? Math.atan2(...velocity) : command.direction;
  figure.command = {
    gait,
    speed,
    direction,
    facing: faces(going!, playback, velocity, arrival),
    facesWay: false,
  };
}

/** The gait of a figure that is to go at a speed: the slowest that goes any way, where its own is too fast for it. */
function slowed({ speeds }: Gaits, gait: number, speed: number): number {
  const low = speeds.map(([slowest, , , sideways, backwards]) =>
    Math.min(sideways, backwards) > 0 ? slowest : Infinity,
  );
  const slow = low.indexOf(Math.min(...low));
  return speed < speeds[gait]![0] && speeds[slow]![0] < speeds[gait]![0] ? slow : gait;
}

function keepApart({ abilities, avoidance }: SteeringModel, figures: Steered[], room: number): void {
  const walkers = figures.map(({ playback: { root, spring } }) => ({ root, velocity: spring }));
  const targets = figures.map(({ command, target }, at): Target => {
    if (!(command.speed > 0)) return target;
    const change = keptApart(walkers[at]!, walkers, room, avoidance);
    return abilities.target(around(command, aside(target, change, avoidance), target[2])).target;
  });
  figures.forEach((figure, at) => (figure.target = targets[at]!));
}

/** A command that goes around others at a velocity. toFace: the facing of its target. */
function around(command: Command, [x, z]: readonly [x: number, z: number], toFace: number): Command {
  const speed = Math.hypot(x, z);
  const direction = speed > 0 ? Math.atan2(x, z) : command.direction;
  const facing = command.facing === command.direction ? direction : toFace;
  return { ...command, speed, direction, facing };
}
