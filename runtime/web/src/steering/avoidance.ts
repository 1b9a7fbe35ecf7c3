/* Figures that keep apart: each turns aside from those that it would come too near to, as motet/steering/avoidance.py says. */
import type { avoidanceSettings } from "../generated.js";
import type { Pose as Ground } from "../motion/planar.js";
import type { Settings } from "../settings.js";

/** Where a figure is, and its velocity in m/s; x and z first. */
export interface Walker {
  root: Ground;
  velocity: readonly number[];
}

/** The change of a figure's velocity, x and z in m/s, by which it keeps `room` metres from others. */
export function keptApart(
  figure: Walker,
  others: readonly Walker[],
  room: number,
  settings: Settings<typeof avoidanceSettings>,
): [x: number, z: number] {
  let changeX = 0;
  let changeZ = 0;
  for (const other of others) {
    const x = figure.root[0] - other.root[0];
    const z = figure.root[1] - other.root[1];
    if (other === figure || Math.abs(x) >= settings.sight || Math.abs(z) >= settings.sight) continue;
    const u = figure.velocity[0]! - other.velocity[0]!;
    const v = figure.velocity[1]! - other.velocity[1]!;
    const soon = Math.min(Math.max(-(x * u + z * v) / Math.max(u * u + v * v, 1e-6), 0), settings.soon);
    const nearX = x + soon * u;
    const nearZ = z + soon * v;
    if (nearX * nearX + nearZ * nearZ >= room * room) continue;
    const by =
      settings.strength *
      Math.min(Math.max(1 - Math.hypot(nearX, nearZ) / room, 0), 1) *
      (1 - soon / settings.soon);
    // head on there is no way away from the other: to the right of the way there
    const [rightX, rightZ] = unit(z, -x);
    const [awayX, awayZ] = unit(nearX + 0.1 * room * rightX, nearZ + 0.1 * room * rightZ);
    changeX += awayX * by;
    changeZ += awayZ * by;
  }
  return [changeX, changeZ];
}

/** A velocity that goes around others, no faster than before; none where it would be too slow. */
export function aside(
  [x, z]: readonly number[],
  change: readonly number[],
  { waits }: Settings<typeof avoidanceSettings>,
): [x: number, z: number] {
  const u = x! + change[0]!;
  const v = z! + change[1]!;
  const speed = Math.hypot(u, v);
  const share = speed > waits ? Math.min(1, Math.hypot(x!, z!) / speed) : 0;
  return [u * share, v * share];
}

function unit(x: number, z: number): [number, number] {
  const length = Math.max(Math.hypot(x, z), 1e-6);
  return [x / length, z / length];
}
