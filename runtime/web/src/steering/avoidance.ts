/* Figures that keep apart by reciprocal velocity obstacles, as motet/steering/avoidance.py says. */
import type { avoidanceSettings } from "../generated.js";
import { clamp } from "../motion/springs.js";
import type { Settings } from "../settings.js";

/** Where a figure would come to rest, its velocity and the one wanted, in m and m/s along x and z; and whether it goes. */
export interface Walker {
  place: readonly [x: number, z: number];
  velocity: readonly number[];
  wanted: readonly number[];
  moves: boolean;
}

/** Velocities that go at least so fast a way, how far that yields, and the distance of the other. */
interface HalfPlane {
  x: number;
  z: number;
  least: number;
  yields: number;
  distance: number;
  push: number;
}

type Avoidance = Settings<typeof avoidanceSettings>;

/** The velocity, near to the one wanted, by which a figure keeps `room` metres from others; the one wanted if none is near. */
export function keptApart(
  figure: Walker,
  others: readonly Walker[],
  room: number,
  settings: Avoidance,
): [x: number, z: number] {
  const planes: HalfPlane[] = [];
  for (const other of others) {
    const x = other.place[0] - figure.place[0];
    const z = other.place[1] - figure.place[1];
    if (other === figure || Math.abs(x) >= settings.sight || Math.abs(z) >= settings.sight) continue;
    const u = figure.velocity[0]! - other.velocity[0]!;
    const v = figure.velocity[1]! - other.velocity[1]!;
    const soon = clamp((x * u + z * v) / Math.max(u * u + v * v, 1e-6), 0, settings.soon);
    if (Math.hypot(x - soon * u, z - soon * v) >= 2 * room) continue;
    const [change, wayX, wayZ] = changed(x, z, u, v, room * (other.moves ? 1 : settings.standing), settings);
    const distance = Math.hypot(x, z);
    planes.push({
      x: wayX,
      z: wayZ,
      least: figure.velocity[0]! * wayX + figure.velocity[1]! * wayZ + (other.moves ? 0.5 : 1) * change,
      yields: settings.yields * Math.max(distance / room - 1, 0.25),
      distance,
      push: 0,
    });
  }
  planes.sort((a, b) => a.distance - b.distance);
  if (!planes.length) return [figure.wanted[0]!, figure.wanted[1]!];
  return nearestAllowed(wish(figure, settings), planes.slice(0, settings.heeds).reverse(), settings);
}

/** A velocity as fast as the one wanted, the farther to the left the less of it is in the figure's velocity. */
function wish({ wanted, velocity }: Walker, settings: Avoidance): [x: number, z: number] {
  const x = wanted[0]!;
  const z = wanted[1]!;
  const gone = (velocity[0]! * x + velocity[1]! * z) / Math.max(x * x + z * z, 1e-9);
  const angle = settings.gives_way * clamp(1 - gone, 0, 1);
  const sin = Math.sin(angle);
  const cos = Math.cos(angle);
  return [x * cos + z * sin, z * cos - x * sin];
}

/** The smallest change of a velocity (u, v) towards (x, z), and its direction, by which the two keep `room` soon; those that are
 *  too near part. */
function changed(
  x: number,
  z: number,
  u: number,
  v: number,
  room: number,
  settings: Avoidance,
): [change: number, wayX: number, wayZ: number] {
  const apart = Math.hypot(x, z);
  if (apart < room) {
    const [awayX, awayZ] = unit(-x, -z);
    return [(room - apart) / settings.parts - (u * awayX + v * awayZ), awayX, awayZ];
  }
  const seconds = Math.min(settings.parts + (apart - room) / settings.closes, settings.soon);
  // velocities that meet are in a cone that a circle cuts off: out of it past the circle
  const offX = u - x / seconds;
  const offZ = v - z / seconds;
  const off = Math.hypot(offX, offZ);
  const towards = offX * x + offZ * z;
  if (towards < 0 && towards ** 2 > room ** 2 * off ** 2) return [room / seconds - off, ...unit(offX, offZ)];
  // or over the nearer leg of the cone
  const leg = Math.sqrt(Math.max(apart ** 2 - room ** 2, 0)) * (x * offZ - z * offX > 0 ? 1 : -1);
  const [wayX, wayZ] = unit(-leg * z - room * x, leg * x - room * z);
  return [-(u * wayX + v * wayZ), wayX, wayZ];
}

/** The velocity near to the one wanted within half-planes, the nearest last: the method of Hildreth and Dykstra. */
function nearestAllowed(
  wanted: readonly number[],
  planes: HalfPlane[],
  settings: Avoidance,
): [x: number, z: number] {
  let x = wanted[0]!;
  let z = wanted[1]!;
  const most = Math.max(Math.hypot(x, z), settings.dodges);
  let slowedX = 0;
  let slowedZ = 0;
  for (let sweep = 0; sweep < settings.sweeps; sweep++) {
    for (const plane of planes) {
      const missing = plane.least - (x * plane.x + z * plane.z);
      const step = Math.max((missing - plane.yields * plane.push) / (1 + plane.yields), -plane.push);
      plane.push += step;
      x += step * plane.x;
      z += step * plane.z;
    }
    // no faster
    const fastX = x + slowedX;
    const fastZ = z + slowedZ;
    const share = Math.min(1, most / Math.max(Math.hypot(fastX, fastZ), 1e-9));
    x = fastX * share;
    z = fastZ * share;
    slowedX = fastX - x;
    slowedZ = fastZ - z;
  }
  return [x, z];
}

/** A vector over the ground of length 1, or less of one shorter than a micrometre. */
export function unit(x: number, z: number): [number, number] {
  const length = Math.max(Math.hypot(x, z), 1e-6);
  return [x / length, z / length];
}
