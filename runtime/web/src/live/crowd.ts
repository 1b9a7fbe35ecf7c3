/* Figures that go by themselves: they follow the first one, wander about, or go to a point. Metres, seconds, radians. */
import { type Asked, type Figure, inRange } from "./figure.js";
import { keptApart, type Walker } from "../steering/avoidance.js";
import { moved, type Pose as Ground } from "../motion/planar.js";
import type { ControlModel } from "../steering/model.js";

/** What figures keep between them, how far they go from the first one, and the room of one in the rows behind it. */
const ROOM = 0.8;
const FAR = 9;
const ROW = 1;
const COLUMN = 0.9;
/** Figures side by side behind the first one. */
const ABREAST = 6;
/** m/s below which a figure stands, and how often one that wanders rests. */
const SLOWEST = 0.25;
const REST = 0.25;

/** The model of a page with what it is asked for often: the speeds of gaits are the lowest, usual and highest. */
export interface Net {
  model: ControlModel;
  gaits: readonly string[];
  speeds: Record<string, readonly number[]>;
  fps: number;
  rows: number;
}

interface Mood {
  left: number;
  way: number;
  pace: number;
  random: () => number;
}

const moods = new WeakMap<Figure, Mood>();

/** What figure n (from 1) of a crowd does next: it goes after the first one, or where its mood leads it. */
export function ownControl(net: Net, figures: Figure[], n: number, follows: boolean): Asked {
  const leader = figures[0]!;
  const figure = figures[n]!;
  const [x, z] = figure.root;
  if (follows || Math.hypot(leader.root[0] - x, leader.root[1] - z) > FAR + n / 3)
    return followed(net, figures, n);
  const mood = moods.get(figure) ?? { left: 0, way: 0, pace: 0, random: randomFrom(n) };
  moods.set(figure, mood);
  if (--mood.left <= 0) Object.assign(mood, newMood(net, figure, mood.random));
  return towards(net, figures, n, [x + 3 * Math.sin(mood.way), z + 3 * Math.cos(mood.way)], mood.pace);
}

/** Numbers between 0 and 1 that look random, the same ones every time: the Lehmer generator. */
function randomFrom(seed: number): () => number {
  let state = (seed * 7919 + 17) % 2147483647;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

/** A way to go for a while, sometimes none. */
function newMood(net: Net, figure: Figure, random: () => number): Omit<Mood, "random"> {
  const rests = random() < REST;
  const way = figure.root[2] + (random() - 0.5) * 4;
  return {
    left: net.fps * (2 + 4 * random()),
    way,
    pace: rests ? 0 : usual(net, 0) * (0.6 + 0.4 * random()),
  };
}

/** The place of figure n in the rows behind the first one, which faces as that does. */
export function placeBehind(first: Ground, n: number): Ground {
  const row = Math.floor((n - 1) / ABREAST);
  const at = (n - 1) % ABREAST;
  const left = COLUMN * (Math.floor(at / 2) + 0.5) * (at % 2 ? 1 : -1);
  return moved(first, [-ROW * (row + 1), left, 0]);
}

function followed(net: Net, figures: Figure[], n: number): Asked {
  const [x, z] = placeBehind(figures[0]!.root, n);
  const figure = figures[n]!;
  const away = Math.hypot(x - figure.root[0], z - figure.root[1]);
  const stays = away < (Math.hypot(...figure.velocity) < 0.1 ? 0.8 : 0.3);
  return towards(net, figures, n, [x, z], stays ? 0 : Math.max(0.7, 1.3 * away));
}

/** A figure that goes on as it is asked. */
function walkerOf(figure: Figure): Walker {
  const { x, z } = figure.wanted;
  return { place: figure.restingPlace, velocity: [x, z], wanted: [x, z], moves: x !== 0 || z !== 0 };
}

/** The control that leads to a point at a pace, around others; faster than the first gait has, it runs. */
export function towards(
  net: Net,
  figures: Figure[],
  n: number,
  [toX, toZ]: readonly [number, number],
  pace: number,
): Asked {
  const figure = figures[n]!;
  const [x, z] = figure.root;
  const away = Math.hypot(toX - x, toZ - z) || 1;
  const walkers = figures.map(walkerOf);
  const walker = { ...walkers[n]!, wanted: [((toX - x) / away) * pace, ((toZ - z) / away) * pace] };
  walkers[n] = walker;
  const [vx, vz] = pace ? keptApart(walker, walkers, ROOM, net.model.avoidance) : [0, 0];
  const wanted = Math.hypot(vx, vz);
  const fast = fastest(net);
  const gait = wanted > (figure.wanted.gait === fast ? 0.8 : 1) * net.speeds[net.gaits[0]!]![2]! ? fast : 0;
  const speed = wanted < SLOWEST ? 0 : inRange(net.model, gait, wanted);
  const ratio = wanted ? speed / wanted : 0;
  return { gait, x: vx * ratio, z: vz * ratio, facing: speed ? Math.atan2(vx, vz) : figure.wanted.facing };
}

/** The usual speed of a gait. */
export function usual({ gaits, speeds }: Net, gait: number): number {
  return speeds[gaits[gait]!]![1]!;
}

/** The gait that is the fastest mostly. */
export function fastest(net: Net): number {
  const speeds = net.gaits.map((_, gait) => net.speeds[net.gaits[gait]!]![1]!);
  return speeds.indexOf(Math.max(...speeds));
}
