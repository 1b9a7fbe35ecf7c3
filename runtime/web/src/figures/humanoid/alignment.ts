/*
 * How joints stand against the humanoid's bones: of each joint the rotation A with which a bone turns as G A, where G is
 * the joint's rotation in the world. From a pose that is a standing body: docs/reference/retargeting.md, "Rest poses that stand".
 */
import type { Body } from "./body.js";
import { ARM, directionOf, LEG, limbOf, SIDES } from "./bones.js";
import { carrierOf, LIMBS } from "./jointMap.js";
import {
  AXES,
  cross,
  dot,
  inverse,
  minus,
  ofVector,
  plus,
  product,
  type Quaternion,
  quaternionOf,
  RADIANS,
  rotated,
  size,
  STILL,
  swing,
  times,
  unit,
  type Vector,
  vectorOf,
  X,
  Y,
  Z,
} from "../../motion/rotations.js";
import type { World } from "../../motion/motion.js";

/** The rotation whose y axis is up, with x as near to left as it can be; or, not upright, x left and y as near to up. */
export function frame(left: Vector, up: Vector, upright = true): Quaternion {
  const [first, other] = upright ? [unit(up), left] : [unit(left), up];
  const square = unit(minus(other, times(first, dot(other, first))));
  const [x, y] = upright ? [square, first] : [first, square];
  return quaternionOf([x, y, cross(x, y)]);
}

const WAYS = AXES.flatMap((axis) => [axis, times(axis, -1)]);
const AXES_TURNS = WAYS.flatMap((x) =>
  WAYS.filter((y) => !dot(x, y)).map((y) => quaternionOf([x, y, cross(x, y)])),
);

/** The nearest rotation that turns axes into axes where it is within some degrees, else the rotation itself. */
export function nearAxes(turn: Quaternion, degrees: number): Quaternion {
  const apart = (other: Quaternion) => size(vectorOf(product(inverse(other), turn)));
  const nearest = AXES_TURNS.reduce((best, other) => (apart(other) < apart(best) ? other : best));
  return apart(nearest) < degrees * RADIANS ? nearest : turn;
}

/** Left, up and forward of a pose that is a standing body, else null; exact, or taken to be axes that it is near. */
export function bodyFrame(pose: Vector[], body: Body, exact = false): Quaternion | null {
  const across = body.toLeft(pose, "UpperLeg");
  const up = body.legsUp(pose);
  if (!size(across) || Math.abs(dot(unit(across), up)) > 0.9) return null;
  const axes = frame(across, up);
  const bodyTurn = exact ? axes : nearAxes(axes, 15);
  return stands(pose, body, bodyTurn) ? bodyTurn : null;
}

/** Whether a pose stands, seen from a frame: legs down, trunk up, feet forward, and the left arm on the left. */
function stands(pose: Vector[], body: Body, bodyTurn: Quaternion): boolean {
  const seen = (vector: Vector) => rotated(inverse(bodyTurn), vector);
  for (const side of SIDES) {
    for (const bone of limbOf(side, LEG.slice(0, 2))) {
      if (body.aimed(bone) && !(seen(body.direction(pose, bone))[1] < -0.75)) return false;
    }
    const foot = `${side}Foot`;
    if (body.aimed(foot) && !(seen(body.direction(pose, foot))[2] > 0.2)) return false;
  }
  if (!(dot(body.trunkUp(pose), rotated(bodyTurn, Y)) > 0.85)) return false;
  return ["UpperArm", "LowerArm"].every((part) => seen(body.toLeft(pose, part))[0] > 0);
}

/** Whether the rest pose is one out of a motion: limbs of left and right differ, and are not along axes. */
export function restsInMotion(body: Body): boolean {
  const { rest } = body.skeleton;
  const bodyTurn = frame(body.toLeft(rest, "UpperLeg"), body.trunkUp(rest));
  const parts = [...LEG.slice(0, 2), ...ARM.slice(1, 3)].filter((part) => body.aimed(`left${part}`));
  const [left, right] = SIDES.map((side) => parts.map((part) => body.direction(rest, side + part))) as [
    Vector[],
    Vector[],
  ];
  const seen = (vector: Vector) => rotated(inverse(bodyTurn), vector);
  const mirrored = ([x, y, z]: Vector): Vector => [-x, y, z];
  const alike = left.map((direction, at) => dot(seen(direction), mirrored(seen(right[at]!))));
  const along = [...left, ...right].map((direction) => Math.max(...direction.map(Math.abs)));
  return Math.min(...alike) < Math.cos(6 * RADIANS) && Math.min(...along) < Math.cos(18 * RADIANS);
}

/** A of all joints that are bones, no turn for others, from the joints' rotations in a standing pose and its frame. */
export function alignmentsOfPose(
  body: Body,
  turns: Quaternion[],
  pose: Vector[],
  bodyTurn: Quaternion,
): Quaternion[] {
  const { map, skeleton } = body;
  const bones = [...Object.keys(map.joints), "spine", "neck"];
  const known = (bone: string) => product(bodyTurn, ofVector(times(map.rest![bone] ?? [0, 0, 0], RADIANS)));
  const wishes = map.rest
    ? Object.fromEntries(bones.map((bone) => [bone, known(bone)]))
    : foundTurns(body, pose, bodyTurn);
  const wanted = new Map(Object.entries(map.joints).map(([bone, joint]) => [joint, wishes[bone]!]));
  wanted.set(carrierOf(map, skeleton), wishes.hips!);
  for (const joint of map.spine) wanted.set(joint, wishes.spine ?? bodyTurn);
  for (const joint of map.neck) wanted.set(joint, wishes.neck ?? bodyTurn);
  return turns.map((turn, joint) => (wanted.has(joint) ? product(inverse(turn), wanted.get(joint)!) : STILL));
}

/** Rotations of the humanoid's bones that make its limbs point where those of the pose do, each carried by the last. */
function foundTurns(body: Body, pose: Vector[], bodyTurn: Quaternion): Record<string, Quaternion> {
  const turned: Record<string, Quaternion> = {
    hips: bodyTurn,
    head: bodyTurn,
    leftShoulder: bodyTurn,
    rightShoulder: bodyTurn,
  };
  for (const limb of LIMBS) {
    let carried = bodyTurn;
    for (const bone of limb.filter((name) => body.map.joints[name] !== undefined)) {
      if (body.aimed(bone) && !bone.endsWith("Toes")) {
        const target = body.direction(pose, bone);
        const start = rotated(carried, directionOf(bone));
        if (bone.endsWith("Foot")) carried = footTurn(target, bodyTurn, carried);
        else if (!bone.endsWith("Hand") || dot(start, target) > 0.8)
          carried = product(swing(start, target), carried);
      }
      turned[bone] = carried;
    }
  }
  return turned;
}

/** A foot's rotation: by its heading alone, rolled with the leg where it lies in the leg's plane. */
function footTurn(target: Vector, body: Quaternion, leg: Quaternion): Quaternion {
  const aside = (turn: Quaternion) => Math.abs(dot(rotated(turn, X), target));
  const base = aside(leg) < aside(body) - 1e-3 ? leg : body;
  const [x, y, z] = rotated(inverse(base), target);
  if (z < 0.5 * Math.hypot(x, y) && z < 0.5)
    return product(swing(rotated(base, directionOf("leftFoot")), target), base);
  return product(base, swing(Z, [x, 0, z]));
}

/** Whether the axes that a convention says fit a skeleton, as its bones point in the frames. */
export function axesAgree(body: Body, { turns, places }: World): boolean {
  const { map } = body;
  const seen = Object.keys(body.aims)
    .filter((bone) => body.aimed(bone))
    .map(
      (bone) => [map.joints[bone]!, directionOf(bone), places.map((pose) => body.along(pose, bone))] as const,
    );
  const left = (part: string) => places.map((pose) => body.toLeft(pose, part));
  seen.push([map.joints.hips!, X, left("UpperLeg")], [map.spine.at(-1)!, X, left("UpperArm")]);
  const known = seen.filter(([joint]) => map.axes[joint]);
  return (
    known.length > 0 &&
    known.every(([joint, direction, along]) => {
      const jointTurns = turns.map((turned) => turned[joint]!);
      const pointing = meanDirection(jointTurns, along);
      return dot(pointing, rotated(knownAxes(map.axes[joint]!), direction)) > 0.7;
    })
  );
}

/** The mean direction of vectors by frame, in the frames of a joint with these rotations. */
export function meanDirection(turns: Quaternion[], along: Vector[]): Vector {
  return unit(
    along.reduce((sum, vector, at) => plus(sum, rotated(inverse(turns[at]!), unit(vector))), [0, 0, 0]),
  );
}

/** The rotation with columns such as "-z x -y". */
export function knownAxes(axes: string): Quaternion {
  const columns = axes
    .split(" ")
    .map((word) => times(AXES["xyz".indexOf(word.at(-1)!)]!, word[0] === "-" ? -1 : 1));
  return quaternionOf(columns as [Vector, Vector, Vector]);
}
