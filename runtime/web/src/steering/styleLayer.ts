/* Styles laid over what figures play, such as "limping", as motet/steering/style_layer.py says. */
import { STYLE_LAYER, STYLES, type styleSettings } from "../generated.js";
import { ControlError } from "../errors.js";
import { BONES, SIDES } from "../figures/humanoid/bones.js";
import { type Limb, legOf, reach } from "../figures/legs.js";
import {
  minus,
  plus,
  product,
  type Quaternion,
  setTurn,
  STILL,
  turnAt,
  type Vector,
} from "../motion/rotations.js";
import { damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import type { Played } from "./step.js";
import styles from "../../../motet/steering/styles.json";

/** A style of the file: its pace is a share of a gait's usual speed; in 0 seconds it goes with the steps. */
interface GivenStyle {
  pace: number;
  seconds: number;
  poses: readonly (readonly number[])[];
}

const FILE = styles as Record<string, GivenStyle>;

/** The names by their numbers. */
export const STYLE_NAMES: readonly string[] = [STYLES.NO_STYLE, ...Object.keys(FILE)];

/** The styles by their numbers; none for 0. */
const BY_NUMBER: readonly (GivenStyle | null)[] = [null, ...Object.values(FILE)];

const TURNED = STYLES.TURNED.map((bone) => BONES.indexOf(bone));
const ARMS = STYLES.ARMS.map((bone) => BONES.indexOf(bone));
/** Where quaternions of the arms and of the feet, moves of the feet and the height of the hips begin in a pose. */
const ARM_TURNS = 4 * TURNED.length;
const FOOT_TURNS = ARM_TURNS + 4 * ARMS.length;
const FOOT_OFFSETS = FOOT_TURNS + 4 * SIDES.length;
const HIPS_LOWER = FOOT_OFFSETS + 3 * SIDES.length;

/** The style of a figure. */
export interface Style {
  /** Their numbers: the one that is wanted, and the one that is shown until it has gone. */
  wanted: number;
  shown: number;
  /** Since that one began. */
  ticks: number;
  /** How much of it the body and the arms show, and how far it is to its second pose; and how fast these change. */
  share: number[];
  rate: number[];
}

/** Of a figure that goes as recorded. */
export function noStyle(): Style {
  return { wanted: 0, shown: 0, ticks: 0, share: [0, 0, 0], rate: [0, 0, 0] };
}

/** The number of a style; ControlError for an unknown one. */
export function styleNumber(name: string): number {
  const number = STYLE_NAMES.indexOf(name);
  if (number < 0)
    throw new ControlError(
      `unknown style ${JSON.stringify(name)}; expected one of ${STYLE_NAMES.join(", ")}`,
    );
  return number;
}

/** The pace of a style, a share of a gait's usual speed. */
export function paceOfStyle(number: number): number {
  return BY_NUMBER[number]?.pace ?? 1;
}

/** A pose in a figure's style, a tick after the last. whole: whether an act leads the body; acts: whether the arms act. */
export function styled(
  style: Style,
  pose: Played,
  whole: boolean,
  acts: boolean,
  settings: Settings<typeof styleSettings>,
  seconds: number,
): void {
  if (!style.wanted && !style.shown) return;
  // another style comes once the one before has gone
  const isGone = style.share[0]! < STYLE_LAYER.LEAST_STYLE;
  if (isGone) style.shown = style.wanted;
  style.ticks = isGone ? 0 : style.ticks + 1;
  const chosen = BY_NUMBER[style.shown];
  // how much of it is wanted, and which of its poses: with the steps, or to and fro
  const stays = !!chosen && style.shown === style.wanted && !whole;
  const [left, right] = pose.contacts;
  const period = chosen?.seconds ?? 0;
  const phase = ((style.ticks * seconds) / (period || 1)) % 1;
  const second = period ? 0.5 - 0.5 * Math.cos(2 * Math.PI * phase) : (1 + left! - right!) / 2;
  // both follow softly
  const goals = [Number(stays), Number(stays && !acts), second];
  const halfLives = [settings.fades, settings.fades, settings.sways];
  goals.forEach((goal, i) => {
    const damping = dampingOf(halfLives[i]!);
    const [off, rate] = damped(style.share[i]! - goal, style.rate[i]!, damping, seconds);
    style.share[i] = goal + off;
    style.rate[i] = rate;
  });
  if (chosen) inStyle(chosen, style.share, pose);
}

function inStyle({ poses }: GivenStyle, [body, arms, second]: number[], pose: Played): void {
  const first = poses[0]!;
  const last = poses.at(-1)!;
  const number = (at: number): number =>
    ((1 - second!) * first[at]! + second! * last[at]!) / STYLES.STEPS_OF_STYLE;
  const numbers = (at: number): Vector => [number(at), number(at + 1), number(at + 2)];
  const turn = (at: number): Quaternion => [...numbers(at), number(at + 3)];
  const { rotations } = pose;
  const played = SIDES.map((_, side) => legOf(rotations, side, turnAt(rotations, 0), [0, pose.height, 0]));

  // trunk and head: turned beyond what is played; arms: as the style has them
  TURNED.forEach((bone, i) => {
    const turned = between(STILL, turn(4 * i), body!);
    setTurn(rotations, bone, product(turned, turnAt(rotations, bone)));
  });
  ARMS.forEach((bone, i) => {
    setTurn(rotations, bone, between(turnAt(rotations, bone), turn(ARM_TURNS + 4 * i), arms!));
  });

  // legs: they reach from the lower hips for the feet
  pose.height -= body! * number(HIPS_LOWER);
  const hips = turnAt(rotations, 0);
  played.forEach(({ turned: before, places }, side) => {
    const { turned, places: moved } = legOf(rotations, side, hips, [0, pose.height, 0]);
    const foot = product(between(STILL, turn(FOOT_TURNS + 4 * side), body!), before[2]);
    const offset = numbers(FOOT_OFFSETS + 3 * side).map((value) => value * body!) as Vector;
    const limb: Limb = { turned: [turned[0], turned[1], foot, turned[3]], places: moved };
    reach(rotations, side, hips, limb, minus(plus(places[2], offset), moved[2]));
  });
}

/** A turn on the way from one to another; where that is zero, the first. */
function between(first: Quaternion, second: Quaternion, share: number): Quaternion {
  const sign = first.reduce((sum, value, i) => sum + value * second[i]!, 0) < 0 ? -1 : 1;
  const mixed = first.map((value, i) => (1 - share) * value + share * sign * second[i]!);
  const length = Math.hypot(...mixed);
  return length > 1e-6 ? (mixed.map((value) => value / length) as Quaternion) : first;
}
