/* Figures that go along paths, arrive at their ends, and keep apart on the way, as motet/steering/paths.py says: commands tick by
 * tick. Metres, seconds, radians; x and z. */
import { keptApart, unit } from "./avoidance.js";
import type { arrivalSettings } from "../generated.js";
import type { Gaits } from "./gaits.js";
import type { Playback, Target } from "./matching.js";
import type { ControlModel } from "./model.js";
import type { Settings } from "../settings.js";
import { hasten, type Steered } from "./steered.js";
import { clamp, dampingOf, wrapped } from "../motion/springs.js";

type Arrival = Settings<typeof arrivalSettings>;
export type Point = readonly [x: number, z: number];

/** A figure on its path. */
export interface Going {
  points: Point[];
  /** Metres to each point. */
  along: number[];
  gone: number;
  speed: number;
  gait: number;
  /** At the end; null for any. */
  facing: number | null;
  /** Whether it is told to stand, and whether it stands at the end. */
  stops: boolean;
  arrived: boolean;
}

/** On a path of two points or more. */
export function sent(points: Point[], order: Pick<Going, "gait" | "speed" | "facing">): Going {
  const along = [0];
  for (let at = 1; at < points.length; at++)
    along.push(along[at - 1]! + distance(points[at - 1]!, points[at]!));
  return { points, along, gone: 0, stops: false, arrived: false, ...order };
}

/** A tick later: the velocity at which the figure is to go, [0, 0] for standing. The place where it would come to rest is led
 *  along the path; the figure follows it. straysFrom: metres from the path beyond which it goes straight on to the next corner. */
function onward(
  going: Going,
  playback: Playback,
  settings: Arrival,
  halfLife: number,
  straysFrom: number,
  seconds: number,
): [x: number, z: number] {
  const rests = restingPlace(playback, halfLife);
  if (distance(at(going, going.gone), rests) > straysFrom) rejoin(going, rests);
  const whole = going.along.at(-1)!;
  // the point of the path where it is to come to rest goes on, slowly in bends and towards the end
  const left = Math.max(whole - going.gone, 0);
  const speed = Math.min(going.speed * slowness(going, settings), Math.sqrt(2 * settings.brakes * left));
  const here = at(going, going.gone);
  going.gone = Math.min(going.gone + step(going, here, rests, speed * seconds, settings), whole);
  const there = at(going, going.gone);
  // stop at the end; arrived: standing there, facing as wanted
  const end = going.points.at(-1)!;
  arrive(going, playback, going.gone >= whole && distance(end, rests) < settings.near, settings);
  if (going.stops) return [0, 0];
  // the velocity at which it comes to that point
  const [onX, onZ] = minus(there, here);
  const [offX, offZ] = minus(here, rests);
  const velocity: Point = [
    onX / seconds + offX / settings.catches_up,
    onZ / seconds + offZ / settings.catches_up,
  ];
  const pace = Math.min(going.speed, Math.hypot(...velocity));
  const [x, z] = unit(...velocity);
  return [x * pace, z * pace];
}

/** Let a figure go on from another place straight to the next point of its path. */
function rejoin(going: Going, place: Point): void {
  const after = next(going, going.gone);
  const start = going.along[after - 1]!;
  const points = going.points.slice();
  points[after - 1] = place;
  const change = distance(points[after]!, place) - (going.along[after]! - start);
  going.along = going.along.map((metres, at) => (at >= after ? metres + change : metres));
  going.points = points;
  going.gone = start;
}

/** The share of its speed at which a figure goes through the bend around where it is on its path: by how much shorter the
 *  straight line through it is. */
function slowness(going: Going, settings: Arrival): number {
  const around = settings.ahead + settings.ahead_moving * going.speed;
  const start = Math.max(going.gone - around, 0);
  const stop = Math.min(going.gone + around, going.along.at(-1)!);
  const chord = distance(at(going, start), at(going, stop));
  const straightness = stop - start > 1e-6 ? chord / (stop - start) : 1;
  return settings.turns_back + (1 - settings.turns_back) * straightness;
}

/** Metres that the point of the path `here` goes on: `metres`, or less while the figure, which would come to rest at `rests`,
 *  is far from there; and as far as the figure is ahead already. */
function step(going: Going, here: Point, rests: Point, metres: number, settings: Arrival): number {
  const off = minus(rests, here);
  const waits = clamp(1 - Math.hypot(...off) / settings.strays, 0, 1);
  const way = unit(...minus(at(going, going.gone + 0.05), here));
  return Math.max(metres * waits, clamp(dot(off, way), 0, 0.1));
}

/** Whether the figure's target is standing, and whether it has arrived. atEnd: whether it comes to rest at the end. */
function arrive(going: Going, { root, spring }: Playback, atEnd: boolean, settings: Arrival): void {
  const far = distance(going.points.at(-1)!, at2(root));
  const stands = Math.hypot(...at2(spring)) < settings.stands;
  going.stops = (going.stops && !(stands && far > settings.glides_from)) || atEnd;
  const turned = going.facing === null || Math.abs(wrapped(root[2] - going.facing)) < settings.faces;
  going.arrived = going.stops && (going.arrived || (stands && far < settings.near && turned));
}

/** Where a figure faces that goes at a velocity: where it goes; near the end as it does, and at the end as it is to. */
function faces(
  { points, facing }: Going,
  { root, spring }: Playback,
  [x, z]: Point,
  settings: Arrival,
): number {
  if (distance(points.at(-1)!, at2(root)) >= settings.sidestep) return Math.atan2(x, z);
  return facing ?? spring[2];
}

/** Move a figure that comes to rest to where it is to stand. */
function settle(
  { points, stops }: Going,
  playback: Playback,
  settings: Arrival,
  halfLife: number,
  seconds: number,
): void {
  const [x, z, facing] = playback.root;
  const off = minus(points.at(-1)!, restingPlace(playback, halfLife));
  const far = Math.hypot(...off);
  if (!stops || far >= settings.glides_from) return;
  const most =
    (settings.glides + settings.glides_moving * Math.hypot(playback.spring[0], playback.spring[1])) * seconds;
  const share = Math.min(seconds / settings.settles, most / Math.max(far, 1e-9));
  playback.root = [x + off[0] * share, z + off[1] * share, facing];
}

/** The point of a path that is so many metres from its beginning. */
function at(going: Going, gone: number): Point {
  const { points, along } = going;
  const after = next(going, gone);
  const start = along[after - 1]!;
  const stop = along[after]!;
  const part = clamp((gone - start) / Math.max(stop - start, 1e-9), 0, 1);
  const from = points[after - 1]!;
  const to = points[after]!;
  return [from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])];
}

/** The first point beyond so many metres, or the last one. */
function next({ along }: Going, gone: number): number {
  const beyond = along.findIndex((metres) => metres > gone);
  return clamp(beyond < 0 ? along.length : beyond, 1, along.length - 1);
}

/** Where a figure comes to rest that is to stand from now on: the springs' integral from where it is. */
export function restingPlace({ root, spring, springRate }: Playback, halfLife: number): Point {
  const damping = dampingOf(halfLife);
  const rolls = (i: number) => (2 * spring[i]! + springRate[i]! / damping) / damping;
  return [root[0] + rolls(0), root[1] + rolls(1)];
}

const at2 = ([x, z]: readonly number[]): Point => [x!, z!];
const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1]];
const dot = (a: Point, b: Point): number => a[0] * b[0] + a[1] * b[1];
const distance = (a: Point, b: Point): number => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Let those that are on a way go on, and those that move keep `room` metres apart, if it is not 0. */
export function lead(model: ControlModel, figures: Steered[], room: number): void {
  const { abilities } = model;
  const before = figures.map(({ target, command }) => ({ target, gait: command.gait }));
  for (const figure of figures) {
    if (figure.going) follow(model, figure, room ? model.avoidance.rejoins : model.arrival.strays);
    figure.target = abilities.target(figure.command).target;
  }
  const targetsBefore = before.map(({ target }) => target);
  if (room) keepApart(model, figures, room, targetsBefore);
  figures.forEach(({ playback, target, command }, at) => {
    const sudden = target.some((value, i) => Math.abs(value - before[at]!.target[i]!) > model.arrival.sudden);
    if (sudden || command.gait !== before[at]!.gait) hasten(playback);
  });
}

/** Command a figure to go on along its path, and move it as it comes to rest at the end. */
function follow(
  { abilities, steerer, arrival, fps }: ControlModel,
  figure: Steered,
  straysFrom: number,
): void {
  const halfLife = steerer.matcher.settings.velocity;
  const { playback, command, going } = figure;
  const velocity = onward(going!, playback, arrival, halfLife, straysFrom, 1 / fps);
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

function keepApart(
  { abilities, avoidance, steerer }: ControlModel,
  figures: Steered[],
  room: number,
  targetsBefore: Target[],
): void {
  const { velocity } = steerer.matcher.settings;
  const walkers = figures.map(({ playback, target, command }, at) => ({
    place: restingPlace(playback, velocity),
    velocity: targetsBefore[at]!,
    wanted: target,
    moves: command.speed > 0,
  }));
  const { aside } = steerer.matcher.settings;
  const targets = figures.map(({ command, target }, at): Target => {
    if (!(command.speed > 0)) return target;
    const [x, z] = keptApart(walkers[at]!, walkers, room, avoidance);
    if (x === target[0] && z === target[1]) return abilities.target(command).target;
    const pace = Math.hypot(x, z);
    const way = Math.atan2(x, z);
    const goes = pace > avoidance.waits;
    // it faces the way around others, unless that leads aside or back
    const along =
      goes && command.facing === command.direction && Math.abs(wrapped(way - command.direction)) < aside;
    const around = {
      ...command,
      speed: goes ? pace : 0,
      direction: goes ? way : command.direction,
      facing: along ? way : target[2],
    };
    return abilities.target(around).target;
  });
  figures.forEach((figure, at) => (figure.target = targets[at]!));
}
