/* One steered figure: what it plays, what it is told, how its feet are held. Sessions and the page of `motet live` have some. */
import { type Acting, begin, laid, noAct } from "./actionLayer.js";
import type { Going } from "./paths.js";
import type { Happenings } from "./events.js";
import { held, type Lock, newLock } from "./footLock.js";
import type { Command } from "./gaits.js";
import { ahead, type Look, looked } from "./lookLayer.js";
import type { Playback, Target } from "./matching.js";
import type { ControlModel } from "./model.js";
import type { Pose as Ground } from "../motion/planar.js";
import { idle, type Reach, reached } from "./reachLayer.js";
import { breathed, kept, notYet, type Standing } from "./idle.js";
import { newPose, type Played, type Steerer } from "./step.js";
import { planOf } from "./stepping.js";
import { noStyle, type Style, styled } from "./styleLayer.js";
import { grounded, type GroundHeight, newTerrain, slowed, type Terrain } from "./terrain.js";
import { type Joints, limited, newJoints } from "./turnLimit.js";

export interface Steered {
  playback: Playback;
  acting: Acting;
  style: Style;
  lock: Lock;
  terrain: Terrain;
  standing: Standing;
  command: Command;
  target: Target;
  /** The path that it is on, if any. */
  going: Going | null;
  look: Look;
  /** Of the left and the right hand. */
  hands: [Reach, Reach];
  joints: Joints;
  /** As it is shown, which the next tick changes. */
  pose: Played;
  /** Of its last tick. */
  happenings: Happenings | null;
}

/** A figure that stands still at a place; with a phase it searches in its turn alone, first after so many ticks. */
export function standing(steerer: Steerer, gait: number, place?: Ground, phase?: number): Steered {
  const facing = place?.[2] ?? 0;
  const { matcher } = steerer;
  const playback = matcher.playing(matcher.stillest(gait), place, phase);
  const command = { gait, speed: 0, direction: 0, facing, facesWay: false };
  const orders: Pick<Steered, "going" | "look" | "hands"> = {
    going: null,
    look: ahead(),
    hands: [idle(), idle()],
  };
  return {
    playback,
    acting: noAct(steerer, playback),
    style: noStyle(),
    lock: newLock(),
    terrain: newTerrain(),
    standing: notYet(),
    command,
    target: [0, 0, facing],
    ...orders,
    joints: newJoints(),
    pose: newPose(),
    happenings: null,
  };
}

/** Set where a figure goes from now on, off any path: a command, and the target that its gait makes of it. */
export function tell(figure: Steered, command: Command, target: Target): void {
  const changed =
    target.some((value, i) => Math.abs(value - figure.target[i]!) > 1e-4) ||
    command.gait !== figure.command.gait;
  if (changed) hasten(figure.playback);
  Object.assign(figure, { command, target, going: null });
}

/** Let a figure that waits for no turn search in the next tick. */
export function hasten(playback: Playback): void {
  if (!playback.inTurn) playback.ticksToSearch = 0;
}

/**
 * The next pose, 1 / fps seconds later, which is the figure's. ground: where it is not flat. raw: a target in place of the figure's own, gone for as it is.
 */
export function tick(
  model: ControlModel,
  figure: Steered,
  holdFeet: boolean,
  ground: GroundHeight | null = null,
  raw?: Target,
): Played {
  const { playback, acting, command, pose } = figure;
  // what it goes for, slower uphill
  const wanted = raw ?? model.abilities.curved(figure.target, command.gait, playback.root[2]);
  const target = ground ? slowed(wanted, playback.root, ground, model.terrain) : wanted;
  const { steerer, idle: settings, fps } = model;
  const [x, z, facing] = playback.root;
  const root: Ground = [x, z, facing];
  const dt = 1 / fps;
  // its steps, and what it does laid over them
  const changed = begin(model, acting, playback, target, command.gait);
  const whole = acting.playing?.whole ?? false;
  steerer.tick(playback, target, command.gait, pose);
  if (holdFeet) kept(figure.standing, pose, playback, root, target, whole, settings, dt);
  laid(model, acting, pose, playback, root, changed);
  if (whole && !command.speed) stand(figure);
  styled(figure.style, pose, whole, !!acting.playing, model.styling, dt);
  // feet held and on the ground
  const plan = whole
    ? null
    : planOf(steerer.matcher, playback, target, command.gait, figure.standing.share, model.steps);
  if (holdFeet) {
    breathed(figure.standing, pose, settings, dt);
    held(figure.lock, pose, model.lock, dt, plan);
  }
  if (ground) grounded(figure.terrain, pose, ground, model.terrain, dt);
  // head and arms as it is told
  looked(figure.look, pose, model.look, dt);
  reached(figure.hands[0], 0, pose, model.reach, dt);
  reached(figure.hands[1], 1, pose, model.reach, dt);
  // joints no faster than people's
  limited(figure.joints, pose, model.turns, dt);
  return pose;
}

/** Who acts with the whole body and is told to stand goes on standing as it does then. */
function stand(figure: Steered): void {
  const facing = figure.playback.root[2];
  figure.command = { ...figure.command, direction: facing, facing };
  figure.target = [0, 0, facing];
}
