/* What a steered figure is told to do, laid over its steps: docs/reference/bundle.md, "Acts". */
import { ACTION_LAYER, MATCHING, actSettings } from "../generated.js";
import { type Act, stepOf } from "./acts.js";
import { BONES, LEG, SIDES } from "../figures/humanoid/bones.js";
import type { Playback, Target } from "./matching.js";
import type { Pose as Ground } from "../motion/planar.js";
import {
  inverse,
  nearestTurn,
  ofVector,
  product,
  type Quaternion,
  size,
  type Vector,
  vectorOf,
} from "../motion/rotations.js";
import { clamp, damped, dampingOf, wrapped } from "../motion/springs.js";
import type { Played, Steerer } from "./step.js";
import type { Settings } from "../settings.js";

const LOWER = ["hips", ...SIDES.flatMap((side) => LEG.map((part) => side + part))];
/** Whether a bone is of the upper body. */
const UPPER = BONES.map((bone) => !LOWER.includes(bone));
const SPINE = BONES.indexOf("spine");
/** From this feature after the trajectory's on they tell of the hands: how the upper body is. */
const HANDS = MATCHING.FEATURES - MATCHING.TRAJECTORY - 6;

/** A pose in its frame of the facing. */
type Body = Pick<Played, "rotations" | "height">;

/** What is played. frame: that is shown. age: ticks since it was begun. yields: whether the legs go as soon as they are told to. */
interface Playing {
  act: Act;
  frame: number;
  age: number;
  whole: boolean;
  yields: boolean;
}

/** The act of one figure. */
export interface Acting {
  playing: Playing | null;
  /** Begun in the next tick, null to end what is played; upper: by the upper body alone, undefined: by the whole body where it stands, or where
   *  the act is one of the legs. */
  request: { act: Act | null; upper: boolean | undefined } | null;
  /** Of the last tick without acts; as it was shown; and as it was shown in the tick before. */
  base: Body;
  shown: Body;
  before: Body;
  /** Whether the act led the whole body in the last tick. */
  led: boolean;
  /** What is added, rotation vectors in the parents' frames and height, how fast it changes, and by which damping it fades. */
  offset: number[];
  offsetRate: number[];
  damping: number;
  /** Velocity over the ground, and the part of it that fades: m/s along x and z, rad/s. */
  going: Ground;
  drift: Ground;
}

/** What acts are laid over steps with. */
export interface ActingModel {
  readonly steerer: Steerer;
  readonly acts: Settings<typeof actSettings>;
  readonly fps: number;
}

/** Of a figure that does nothing but stand or go. */
export function noAct(steerer: Steerer, playback: Playback): Acting {
  const base = steerer.body(playback);
  const none = () => Array<number>(3 * BONES.length + 1).fill(0);
  const body = { base, shown: base, before: base };
  return {
    playing: null,
    request: null,
    ...body,
    led: false,
    offset: none(),
    offsetRate: none(),
    damping: 0,
    going: [0, 0, 0],
    drift: [0, 0, 0],
  };
}

/** What a figure does, and the seconds that are left of it. */
export interface Doing {
  name: string;
  left: number;
}

export function doing({ playing, request }: Acting, fps: number): Doing | null {
  if (request) return request.act && { name: request.act.name, left: (request.act.height.length - 1) / fps };
  return playing && { name: playing.act.name, left: (playing.act.height.length - 1 - playing.frame) / fps };
}

/** Before a tick: go on by a frame, begin what is asked, end what is over. Whether something else is shown from now on. */
export function begin(
  model: ActingModel,
  acting: Acting,
  playback: Playback,
  target: Target,
  gait: number,
): boolean {
  const { playing: now, request } = acting;
  if (!now && !request) return false;
  const goes = Math.hypot(target[0], target[1]) > 0;
  const after = !request
    ? next(now!, goes)
    : request.act && entered(model, acting, request.act, request.upper, playback, goes);
  acting.playing = after;
  acting.request = null;
  if (now?.whole && !after?.whole) {
    const { steerer } = model;
    steerer.matcher.follow(playback, target, gait, steerer.matcher.scaled(now.act.features[now.frame]!));
    acting.base = steerer.body(playback);
  }
  return !!request || !after || after.whole !== now?.whole;
}

function next(now: Playing, goes: boolean): Playing | null {
  if (now.frame + 1 >= now.act.height.length) return null;
  return { ...now, frame: now.frame + 1, age: now.age + 1, whole: now.whole && !(goes && now.yields) };
}

/** The act that is asked for, at the frame after the one that is most like the figure. */
function entered(
  { steerer: { matcher }, acts: settings, fps }: ActingModel,
  { playing }: Acting,
  act: Act,
  upper: boolean | undefined,
  playback: Playback,
  goes: boolean,
): Playing {
  const moves = goes || Math.hypot(playback.spring[0], playback.spring[1]) > matcher.settings.idle;
  const stays = moves && act.legs; // its legs go on as it ends
  const whole = upper === undefined ? stays || !moves : !upper;
  const isNow = matcher.now(playback);
  if (playing)
    matcher
      .scaled(playing.act.features[playing.frame]!)
      .forEach((value, i) => (playing.whole || i >= HANDS) && (isNow[i] = value));
  const entries = Math.min(Math.round(settings.entry * fps), Math.floor((act.height.length - 1) / 3)) + 1;
  let best = 0;
  let least = Infinity;
  for (let frame = 0; frame < entries; frame++) {
    const off = matcher.scaled(act.features[frame]!).map((value, i) => value - isNow[i]!);
    const cost = (whole ? off : off.slice(HANDS)).reduce((sum, value) => sum + value * value, 0);
    if (cost < least) {
      best = frame;
      least = cost;
    }
  }
  return { act, frame: best + 1, age: 0, whole, yields: upper === undefined && !stays };
}

/** After a tick: its pose with the act laid over it, and the figure where that leads. root: before the tick. */
export function laid(
  { acts: settings, steerer: { matcher } }: ActingModel,
  acting: Acting,
  pose: Played,
  playback: Playback,
  root: Ground,
  changed: boolean,
): Played {
  const { dt } = matcher;
  const { playing, base } = acting;
  acting.base = { rotations: pose.rotations, height: pose.height };
  // how the figure goes: as the act, or as its steps
  const step: Ground = playing?.whole
    ? stepOf(playing.act, playing.frame, root[2])
    : [playback.root[0] - root[0], playback.root[1] - root[1], wrapped(playback.root[2] - root[2])];
  // inertialization: a jump in the pose becomes an offset that fades
  if (changed) lose(acting, settings, base, step, dt);
  acting.before = acting.shown;
  acting.led = !!playing?.whole;
  if (!playing && !acting.offset.some((value) => value)) {
    acting.shown = acting.base;
    acting.going = each((i) => step[i]! / dt);
    return pose;
  }
  // the pose is the act, or the steps, and what is left of the offset
  fade(acting, settings, dt);
  acting.shown = plus(source(acting, acting.base, 0), acting.offset);
  acting.going = each((i) => step[i]! / dt + acting.drift[i]!);
  // the figure goes where that leads
  const to = playing?.whole ? each((i) => root[i]! + step[i]!) : playback.root;
  playback.root = [
    to[0] + acting.drift[0] * dt,
    to[1] + acting.drift[1] * dt,
    wrapped(to[2] + acting.drift[2] * dt),
  ];
  if (playing?.whole) {
    playback.spring = [acting.going[0], acting.going[1], playback.root[2]];
    playback.springRate = [0, 0, 0];
  }
  return {
    ...acting.shown,
    ground: playback.root,
    contacts: playing?.whole ? playing.act.contacts[playing.frame]! : pose.contacts,
  };
}

function each(value: (i: number) => number): Ground {
  return [value(0), value(1), value(2)];
}

/**
 * What is lost from the last tick to this one is added: of the upper body, and where an act leads the whole body, or led it, of
 * all of it and of the velocity. base: of the last tick without acts.
 */
function lose(
  acting: Acting,
  { blend, far, height_weight, longest }: Settings<typeof actSettings>,
  base: Body,
  step: Ground,
  dt: number,
): void {
  const { shown, before } = acting;
  const ahead = since(plus(shown, since(shown, before)), source(acting, acting.base, 0));
  const off = since(shown, source(acting, base, 1));
  BONES.forEach((_, bone) =>
    off.splice(3 * bone, 3, ...nearestTurn(vectorAt(off, bone), vectorAt(ahead, bone))),
  );
  const leads = acting.led || acting.playing?.whole;
  const isNew = (i: number) => leads || UPPER[Math.floor(i / 3)];
  acting.offsetRate = ahead.map((value, i) => (isNew(i) ? (value - off[i]!) / dt : acting.offsetRate[i]!));
  acting.offset = off.map((value, i) => (isNew(i) ? value : acting.offset[i]!));
  const farthest = Math.max(
    ...BONES.map((_, bone) => size(vectorAt(acting.offset, bone))),
    height_weight * Math.abs(acting.offset.at(-1)!),
  );
  acting.damping = dampingOf(blend) / clamp(farthest / far, 1, longest);
  if (leads) acting.drift = each((i) => acting.going[i]! - step[i]! / dt);
}

/** What is added, a tick later; nothing once nothing is seen of it. */
function fade(acting: Acting, { blend }: Settings<typeof actSettings>, dt: number): void {
  const later = acting.offset.map((off, i) => damped(off, acting.offsetRate[i]!, acting.damping, dt));
  const left = later.some(([off]) => Math.abs(off) > ACTION_LAYER.FADED) ? 1 : 0;
  acting.offset = later.map(([off]) => left * off);
  acting.offsetRate = later.map(([, rate]) => left * rate);
  acting.drift = each((i) => acting.drift[i]! * left * 0.5 ** (dt / blend));
}

/** What is played, over a base, so many frames before. */
function source({ playing }: Acting, base: Body, back: number): Body {
  if (!playing) return base;
  const { act, frame, whole } = playing;
  const rotations = act.rotations[frame - back]!;
  if (whole) return { rotations, height: act.height[frame - back]! };
  const blended = base.rotations.map((rotation, bone) => (UPPER[bone] ? rotations[bone]! : rotation));
  blended[SPINE] = product(inverse(base.rotations[0]!), product(rotations[0]!, rotations[SPINE]!));
  return { rotations: blended, height: base.height };
}

function vectorAt(more: number[], bone: number): Vector {
  return more.slice(3 * bone, 3 * bone + 3) as Vector;
}

/** What is to be added to another body to make it this one. */
function since(body: Body, other: Body): number[] {
  const turns = body.rotations.map((rotation, bone) =>
    vectorOf(product(rotation, inverse(other.rotations[bone]!))),
  );
  return [...turns.flat(), body.height - other.height];
}

function plus({ rotations, height }: Body, more: number[]): Body {
  const turned = rotations.map((rotation, bone): Quaternion =>
    product(ofVector(vectorAt(more, bone)), rotation),
  );
  return { rotations: turned, height: height + more.at(-1)! };
}
