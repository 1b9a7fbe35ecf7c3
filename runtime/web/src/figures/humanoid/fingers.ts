import { RETARGET } from "../../generated.js";
import { SIDES } from "./bones.js";
import { worldOf } from "../../motion/motion.js";
import {
  cross,
  dot,
  inverse,
  mean,
  minus,
  ofVector,
  plus,
  product,
  type Quaternion,
  rotated,
  times,
  unit,
  type Vector,
} from "../../motion/rotations.js";
import type { Skeleton } from "../../motion/skeleton.js";

/** What the names of a finger's joints hold, and how far it is bent in a relaxed hand, times a finger's bend. */
const SHARES = Object.entries(RETARGET.FINGER_SHARES).map(([words, share]): [RegExp, number] => [
  new RegExp(words),
  share,
]);
const THUMB = 0;
const INDEX = 1;

/** Local rotations of a pose with its hands relaxed (docs/reference/retargeting.md, "Fingers"); joints: of "leftHand", "rightHand". */
export function relaxed(
  skeleton: Skeleton,
  still: Quaternion[],
  joints: Record<string, number>,
): Quaternion[] {
  // the hands at rest, in the world
  const offsets = skeleton.joints.map((joint) => joint.offset);
  const { turns, places } = worldOf({ skeleton, rotations: [still], translations: [offsets] });
  const bent = [...still];
  SIDES.forEach((side, at) => {
    const hand = joints[`${side}Hand`];
    if (hand === undefined) return;
    bendFingers(fingersOf(skeleton, hand), hand, at ? 1 : -1, turns[0]!, places[0]!, bent);
  });
  return bent;
}

function bendFingers(
  fingers: Map<number, number[]>,
  hand: number,
  sign: number,
  turns: Quaternion[],
  places: Vector[],
  bent: Quaternion[],
): void {
  const knuckles = [...fingers].filter(([finger]) => finger !== THUMB).map(([, chain]) => places[chain[0]!]!);
  if (!fingers.has(INDEX) || knuckles.length < 2) return;
  const along = unit(minus(mean(knuckles), places[hand]!));
  const across = unit(minus(knuckles.at(-1)!, knuckles[0]!));
  const palm = unit(times(cross(along, across), sign));
  for (const [finger, chain] of fingers) {
    const bones = chain.slice(1).map((after, at) => unit(minus(places[after]!, places[chain[at]!]!)));
    // the last joint, where it has no tip, points where the one before it does
    const pointing: Vector[] = bones.length ? [...bones, bones.at(-1)!] : [[0, 0, 0]];
    const start = finger === THUMB ? pointing[0]! : along;
    const axis = cross(start, finger === THUMB ? plus(palm, across) : palm);
    chain.slice(0, Math.min(pointing.length, RETARGET.FINGER_BENDS.length)).forEach((joint, at) => {
      const before = at ? pointing[at - 1]! : start;
      const bone = pointing[at]!;
      const aside = unit(minus(axis, times(bone, dot(axis, bone))));
      const now = Math.atan2(
        dot(cross(before, bone), aside),
        dot(before, bone) - dot(before, aside) * dot(bone, aside),
      );
      const wanted = ((RETARGET.FINGER_BENDS[at]! * Math.PI) / 180) * SHARES[finger]![1];
      const turn = times(aside, Math.max(0, wanted - now));
      bent[joint] = product(bent[joint]!, ofVector(rotated(inverse(turns[joint]!), turn)));
    });
  }
}

/** The fingers of a hand by the names of its joints: the joints of each, from the knuckle on, from thumb to little finger. */
function fingersOf(skeleton: Skeleton, hand: number): Map<number, number[]> {
  const chains = new Map<number, number[]>();
  for (const joint of skeleton.under(hand)) {
    const name = skeleton.names[joint]!.toLowerCase();
    const finger = SHARES.findIndex(([words]) => words.test(name));
    if (joint === hand || finger < 0 || (finger !== THUMB && /meta|carpal|palm|inhand/.test(name))) continue;
    const chain = chains.get(finger);
    if (!chain) chains.set(finger, [joint]);
    else if (skeleton.joints[joint]!.parent === chain.at(-1)) chain.push(joint);
  }
  return new Map([...chains].sort(([a], [b]) => a - b));
}
