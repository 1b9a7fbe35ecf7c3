/* Euler angles in radians: an order such as "zyx" is the product Rz Ry Rx, and angles are listed as the order is. */
import { ROTATIONS } from "../generated.js";
import { about, AXES, product, type Quaternion, rotated, type Vector } from "./rotations.js";

export function fromEuler(angles: Vector, order: string): Quaternion {
  const [a, b, c] = angles.map((angle, at) => about(AXES["xyz".indexOf(order[at]!)]!, angle)) as [
    Quaternion,
    Quaternion,
    Quaternion,
  ];
  return product(product(a, b), c);
}

/** The angles of rotations one after the other, which do not leap; at a gimbal lock the last angle stays. */
export function eulersOf(turns: Quaternion[], order: string): Vector[] {
  let free = 0;
  const angles = turns.map((turn): Vector => {
    const [first, middle, last] = toEuler(turn, order);
    if (Math.abs(middle) <= Math.PI / 2 - ROTATIONS.LOCKED) {
      free = last;
      return [first, middle, last];
    }
    return [first - handedness(order) * Math.sign(middle) * (free - last), middle, free];
  });
  return continuous(angles);
}

/** Of the two solutions of each frame, each up to whole turns, the one nearest to the frame before. */
function continuous(angles: Vector[]): Vector[] {
  let flipped = false;
  let last = angles[0]!;
  return angles.map((triple, at) => {
    if (at === 0) return triple;
    const same = near(solution(triple, flipped), last);
    const other = near(solution(triple, !flipped), last);
    const changes = apart(other, last) < apart(same, last) - 1e-9;
    flipped = flipped !== changes;
    last = changes ? other : same;
    return last;
  });
}

function solution([a, b, c]: Vector, flipped: boolean): Vector {
  return flipped ? [a + Math.PI, Math.PI - b, c + Math.PI] : [a, b, c];
}

function near(angles: Vector, to: Vector): Vector {
  return angles.map(
    (angle, at) => angle - 2 * Math.PI * Math.round((angle - to[at]!) / (2 * Math.PI)),
  ) as Vector;
}

function apart(a: Vector, b: Vector): number {
  return a.reduce((sum, angle, at) => sum + Math.abs(angle - b[at]!), 0);
}

/** The middle angle is within a quarter turn; the last is 0 at a gimbal lock. */
function toEuler(turn: Quaternion, order: string): Vector {
  const [i, j, k] = Array.from(order, (axis) => "xyz".indexOf(axis)) as Vector;
  const columns = AXES.map((axis) => rotated(turn, axis));
  const entry = (row: number, column: number) => columns[column]![row]!;
  const sign = handedness(order);
  const cosine = Math.hypot(entry(i, i), entry(i, j));
  const middle = Math.atan2(sign * entry(i, k), cosine);
  if (cosine < ROTATIONS.LOCKED) return [Math.atan2(sign * entry(k, j), entry(j, j)), middle, 0];
  return [Math.atan2(-sign * entry(j, k), entry(k, k)), middle, Math.atan2(-sign * entry(i, j), entry(i, i))];
}

function handedness(order: string): number {
  return "xyzxy".includes(order) ? 1 : -1;
}
