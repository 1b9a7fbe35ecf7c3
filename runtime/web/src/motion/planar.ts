/** Where a figure is on the ground and how it faces: x, z in metres, and radians about y, 0 along z. */
export type Pose = [number, number, number];

/** The length of a vector on the ground; Math.hypot takes ten times as long. */
export function lengthOf(x: number, z: number): number {
  return Math.sqrt(x * x + z * z);
}

/** The pose that a move leads to: forward and to the left in metres, and a turn to the left in radians. */
export function moved([x, z, facing]: Pose, [forward, left, turn]: Pose): Pose {
  const sin = Math.sin(facing);
  const cos = Math.cos(facing);
  return [x + forward * sin + left * cos, z + forward * cos - left * sin, facing + turn];
}

/** The move that leads from one pose to another. */
export function seenFrom([x, z, facing]: Pose, [toX, toZ, toFacing]: Pose): Pose {
  const sin = Math.sin(facing);
  const cos = Math.cos(facing);
  return [(toX - x) * sin + (toZ - z) * cos, (toX - x) * cos - (toZ - z) * sin, toFacing - facing];
}
