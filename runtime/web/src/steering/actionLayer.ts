/* What a steered figure is told to do, laid over its steps: docs/reference/bundle.md, "Acts". */
import { ACTION_LAYER, MATCHING, actSettings } from "../generated.js";
import { type Act, stepOf } from "./acts.js";
import { BONES, LEG, SIDES } from "../figures/humanoid/bones.js";
import type { Playback, Target } from "./matching.js";
import type { ControlModel } from "./model.js";
import type { Pose as Ground } from "../motion/planar.js";
import {
  inverse,
  nearestTurn,
  ofVector,
  product,
  setTurn,
  size,
  turnAt,
  type Vector,
  vectorOf,
} from "../motion/rotations.js";
import { clamp, damp, dampingOf, wrapped } from "../motion/springs.js";
import { type Body, newPose, place, type Played, type Steerer } from "./step.js";
import type { Settings } from "../settings.js";

const LOWER = ["hips", ...SIDES.flatMap((side) => LEG.map((part) => side + part))];
/** Whether a bone is of the upper body. */
const UPPER = BONES.map((bone) => !LOWER.includes(bone));
const SPINE = BONES.indexOf("spine");
/** From this feature after the trajectory's on they tell of the hands: how the upper body is. */
const HANDS = MATCHING.FEATURES - MATCHING.TRAJECTORY - 6;

/** A rotation vector of each bone, and the height. */
const WIDTH = 3 * BONES.length + 1;

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
  offset: Float64Array;
  offsetRate: Float64Array;
  damping: number;
  /** Velocity over the ground, and the part of it that fades: m/s along x and z, rad/s. */
  going: Ground;
  drift: Ground;
}

/** Of a figure that does nothing but stand or go. */
export function noAct(steerer: Steerer, playback: Playback): Acting {
  const body = () => {
    const pose = newPose();
    steerer.body(playback, pose);
    return pose;
  };
  return {
    playing: null,
    request: null,
    base: body(),
    shown: body(),
    before: body(),
    led: false,
    offset: new Float64Array(WIDTH),
    offsetRate: new Float64Array(WIDTH),
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
  model: ControlModel,
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
    steerer.body(playback, acting.base);
  }
  return !!request || !after || after.whole !== now?.whole;
}

function next(now: Playing, goes: boolean): Playing | null {
  if (now.frame + 1 >= now.act.height.length) return null;
  return { ...now, frame: now.frame + 1, age: now.age + 1, whole: now.whole && !(goes && now.yields) };
}

/** The act that is asked for, at the frame after the one that is most like the figure. */
function entered(
  { steerer: { matcher }, acts: settings, fps }: ControlModel,
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

/** After a tick: lay the act over its pose, and put the figure where that leads. root: before the tick. */
export function laid(
  { acts: settings, steerer: { matcher } }: ControlModel,
  acting: Acting,
  pose: Played,
  playback: Playback,
  root: Ground,
  changed: boolean,
): void {
  const { dt } = matcher;
  const { playing, going, drift } = acting;
  // how the figure goes: as the act, or as its steps
  const step: Ground = playing?.whole
    ? stepOf(playing.act, playing.frame, root[2])
    : [playback.root[0] - root[0], playback.root[1] - root[1], wrapped(playback.root[2] - root[2])];
  // inertialization: a jump in the pose becomes an offset that fades
  if (changed) lose(acting, settings, pose, step, dt);
  acting.led = !!playing?.whole;
  // what was shown last is before what is shown now
  const { shown, before } = acting;
  acting.shown = before;
  acting.before = shown;
  copyBody(acting.base, pose);
  if (!playing && !acting.offset.some((value) => value !== 0)) {
    copyBody(acting.shown, pose);
    for (let i = 0; i < 3; i++) going[i] = step[i]! / dt;
    return;
  }
  // the pose is the act, or the steps, and what is left of the offset
  fade(acting, settings, dt);
  source(acting, acting.base, 0, pose);
  add(pose, acting.offset);
  copyBody(acting.shown, pose);
  // the figure goes where that leads
  for (let i = 0; i < 3; i++) {
    going[i] = step[i]! / dt + drift[i]!;
    if (playing?.whole) playback.root[i] = root[i]! + step[i]!;
    playback.root[i]! += drift[i]! * dt;
  }
  playback.root[2] = wrapped(playback.root[2]);
  place(pose, playback);
  if (playing?.whole) {
    playback.spring = [going[0], going[1], playback.root[2]];
    playback.springRate = [0, 0, 0];
    const [left, right] = playing.act.contacts[playing.frame]!;
    pose.contacts[0] = left;
    pose.contacts[1] = right;
  }
}

function copyBody(body: Body, other: Body): void {
  body.rotations.set(other.rotations);
  body.height = other.height;
}

/**
 * What is lost from the last tick to this one is added: of the upper body, and where an act leads the whole body, or led it, of
 * all of it and of the velocity. pose: of this tick without acts.
 */
function lose(
  acting: Acting,
  { blend, far, height_weight, longest }: Settings<typeof actSettings>,
  pose: Body,
  step: Ground,
  dt: number,
): void {
  const { shown, before, base, offset, offsetRate } = acting;
  // how it would go on, and how it was, beside what is played
  const [next, last, going] = [newPose(), newPose(), newPose()];
  source(acting, pose, 0, next);
  source(acting, base, 1, last);
  copyBody(going, shown);
  add(going, since(shown, before));
  const ahead = since(going, next);
  const off = since(shown, last);
  BONES.forEach((_, bone) => off.set(nearestTurn(vectorAt(off, bone), vectorAt(ahead, bone)), 3 * bone));
  const leads = acting.led || acting.playing?.whole;
  off.forEach((value, i) => {
    if (!leads && !UPPER[Math.floor(i / 3)]) return;
    offset[i] = value;
    offsetRate[i] = (ahead[i]! - value) / dt;
  });
  const farthest = Math.max(
    ...BONES.map((_, bone) => size(vectorAt(offset, bone))),
    height_weight * Math.abs(offset.at(-1)!),
  );
  acting.damping = dampingOf(blend) / clamp(farthest / far, 1, longest);
  for (let i = 0; i < 3 && leads; i++) acting.drift[i] = acting.going[i]! - step[i]! / dt;
}

/** What is added, a tick later; nothing once nothing is seen of it. */
function fade(acting: Acting, { blend }: Settings<typeof actSettings>, dt: number): void {
  const { offset, offsetRate, drift } = acting;
  damp(offset, offsetRate, acting.damping, dt);
  for (let i = 0; i < 3; i++) drift[i]! *= 0.5 ** (dt / blend);
  if (offset.some((off) => Math.abs(off) > ACTION_LAYER.FADED)) return;
  offset.fill(0);
  offsetRate.fill(0);
  drift.fill(0);
}

/** What is played, over a base, so many frames before, into a body. */
function source({ playing }: Acting, base: Body, back: number, into: Body): void {
  copyBody(into, base);
  if (!playing) return;
  const { act, frame, whole } = playing;
  const rotations = act.rotations[frame - back]!;
  if (whole) {
    into.rotations.set(rotations);
    into.height = act.height[frame - back]!;
    return;
  }
  for (let bone = 0; bone < BONES.length; bone++)
    if (UPPER[bone]) setTurn(into.rotations, bone, turnAt(rotations, bone));
  const spine = product(turnAt(rotations, 0), turnAt(rotations, SPINE));
  setTurn(into.rotations, SPINE, product(inverse(turnAt(base.rotations, 0)), spine));
}

function vectorAt(more: Float64Array, bone: number): Vector {
  const at = 3 * bone;
  return [more[at]!, more[at + 1]!, more[at + 2]!];
}

/** What is to be added to another body to make it this one. */
function since(body: Body, other: Body): Float64Array {
  const more = new Float64Array(WIDTH);
  BONES.forEach((_, bone) => {
    const turn = product(turnAt(body.rotations, bone), inverse(turnAt(other.rotations, bone)));
    more.set(vectorOf(turn), 3 * bone);
  });
  more[WIDTH - 1] = body.height - other.height;
  return more;
}

function add(body: Body, more: Float64Array): void {
  const { rotations } = body;
  for (let bone = 0; bone < BONES.length; bone++)
    setTurn(rotations, bone, product(ofVector(vectorAt(more, bone)), turnAt(rotations, bone)));
  body.height += more[WIDTH - 1]!;
}
