/* Figures that look at points: head, neck and upper spine share the turn, within what people can do, as motet/steering/look_layer.py says. */
import { LOOK_LAYER, type lookSettings } from "../generated.js";
import { type Follower, followed, followerAt, shownBy } from "./follower.js";
import { BONES, OFFSETS } from "../figures/humanoid/bones.js";
import {
  about,
  inverse,
  minus,
  plus,
  product,
  type Quaternion,
  rotated,
  setTurn,
  size,
  STILL,
  turnAt,
  type Vector,
  Y,
  Z,
} from "../motion/rotations.js";
import type { Settings } from "../settings.js";
import { clamp } from "../motion/springs.js";
import { type Played, seenBy } from "./step.js";

/** Bones that turn, and the share of the turn that each and those below it make together. */
const SHARES = Object.entries(LOOK_LAYER.SHARES).map(([name, share]): [bone: number, share: number] => [
  BONES.indexOf(name),
  share,
]);
const SPINE = BONES.indexOf("spine");

/** What a figure looks at, and the angles by which its head is turned to the left and up, more than is played. */
export interface Look {
  point: Vector | null;
  turn: Follower;
}

/** Of a figure that looks at nothing. */
export function ahead(): Look {
  return { point: null, turn: followerAt([0, 0]) };
}

/** Turn the head of a pose, a tick after the last; the look goes on. */
export function looked(
  look: Look,
  pose: Played,
  settings: Settings<typeof lookSettings>,
  seconds: number,
): void {
  if (!look.point && shownBy(look.turn).every((angle) => Math.abs(angle) <= LOOK_LAYER.LEAST_TURN)) return;
  const seen = bonesOf(pose);
  const now = angles(rotated(seen.at(-1)!, Z));
  const goal = wanted(look, pose, seen, now, settings);
  look.turn = followed(look.turn, goal, settings.leap, settings.half_life, seconds);
  let above: Quaternion = STILL;
  turned(seen, now[0], shownBy(look.turn)).forEach((bone, i) => {
    setTurn(pose.rotations, SHARES[i]![0], product(inverse(above), bone));
    above = bone;
  });
}

/** The turn that is wanted, to the left and up, of bones in the frame of the lower spine, the last of which looks at angles. */
function wanted(
  { point, turn }: Look,
  pose: Played,
  seen: Quaternion[],
  now: [left: number, up: number],
  settings: Settings<typeof lookSettings>,
): number[] {
  if (!point) return [0, 0];
  const aim = minus(seenBy([SPINE], pose, point), eyes(turned(seen, now[0], shownBy(turn)))); // as they were turned a tick ago
  if (!(size(aim) > settings.near)) return [0, 0];
  const [toSide, up] = angles(aim);
  let left = toSide;
  if (Math.abs(left) > settings.behind) left = Math.abs(left) * (now[0] + turn.wanted[0]! < 0 ? -1 : 1);
  left *= Math.min(Math.hypot(aim[0], aim[2]) / settings.under, 1);
  return [
    clamp(left, -settings.aside, settings.aside) - now[0],
    clamp(up, -settings.up, settings.up) - now[1],
  ];
}

/** Rotations of the bones that turn in the frame of the lower spine. */
function bonesOf({ rotations }: Played): Quaternion[] {
  let above: Quaternion = STILL;
  return SHARES.map(([bone]) => (above = product(above, turnAt(rotations, bone))));
}

/** Where the eyes are in the frame of the lower spine. */
function eyes(bones: Quaternion[]): Vector {
  let place: Vector = [0, 0, 0];
  let above: Quaternion = STILL;
  bones.forEach((bone, i) => {
    place = plus(place, rotated(above, OFFSETS[SHARES[i]![0]]!));
    above = bone;
  });
  return plus(place, rotated(above, [...LOOK_LAYER.EYES_OFFSET]));
}

/** Of a direction, to the left and up. */
function angles([x, y, z]: Vector): [left: number, up: number] {
  return [Math.atan2(x, z), Math.atan2(y, Math.hypot(x, z))];
}

/** Bones turned by their shares of angles, from a gaze so far to the left. */
function turned(bones: Quaternion[], gaze: number, [left, up]: number[]): Quaternion[] {
  return bones.map((bone, i) => {
    const share = SHARES[i]![1];
    const way = gaze + share * left!;
    const half = (share * up!) / 2;
    const sine = Math.sin(half);
    const lifted: Quaternion = [-Math.cos(way) * sine, 0, Math.sin(way) * sine, Math.cos(half)];
    return product(lifted, product(about(Y, share * left!), bone));
  });
}
