/* Figures on ground that is not flat, as motet/steering/terrain.py says. Metres, seconds and radians. */
import { TERRAIN, type terrainSettings } from "../generated.js";
import { ControlError } from "../errors.js";
import { type Limb, legOf, reach } from "../figures/legs.js";
import {
  about,
  minus,
  plus,
  product,
  rotated,
  size,
  swing,
  turnAt,
  type Vector,
  Y,
} from "../motion/rotations.js";
import { clamp, damped, dampingOf } from "../motion/springs.js";
import type { Settings } from "../settings.js";
import { solePoints } from "./footLock.js";
import type { Target } from "./matching.js";
import type { Played } from "./step.js";

type Numbers = Settings<typeof terrainSettings>;

/** A number, and how fast it changes. */
type Moving = [value: number, rate: number];

/** The height of the ground in metres at a place. */
export type GroundHeight = (x: number, z: number) => number;

/** Of a foot how much it is raised, and the slope that it is tilted to, rise along x and along z. */
interface Foot {
  height: Moving;
  slope: [Moving, Moving];
}

/** One figure on its ground. */
export interface Terrain {
  /** x and z of the hips in the last tick, null before the first. */
  place: [x: number, z: number] | null;
  /** How much the hips are raised. */
  hips: Moving;
  feet: [Foot, Foot];
}

/** A leg as it is on the plane, its foot tilted to the slope, and what the ground asks of it. */
interface Leg {
  limb: Limb;
  stands: boolean;
  /** The share of its swing that the foot has made. */
  swung: number;
  ankle: Vector;
  height: number;
  /** How much the foot has to be raised where it will land. */
  landing: number;
}

export function newTerrain(): Terrain {
  const foot = (): Foot => ({
    height: [0, 0],
    slope: [
      [0, 0],
      [0, 0],
    ],
  });
  return { place: null, hips: [0, 0], feet: [foot(), foot()] };
}

/** A function for heights that is checked at each place. */
export function checkedGround(ground: GroundHeight): GroundHeight {
  if (typeof ground !== "function")
    throw new ControlError("ground must be a function of x and z that gives a height in metres");
  return (x, z) => {
    const height = heightAt(ground, x, z);
    if (!(typeof height === "number" && Math.abs(height) <= TERRAIN.HIGHEST_GROUND))
      throw new ControlError(
        `ground(x, z) gave ${height} at x ${x}, z ${z}: a height is a number within ${TERRAIN.HIGHEST_GROUND} m of 0`,
      );
    return height;
  };
}

/** What a function gives for a place; an error of its own names the place. */
function heightAt(ground: GroundHeight, x: number, z: number): number {
  try {
    return ground(x, z);
  } catch (error) {
    throw new ControlError(`ground(x, z) failed at x ${x}, z ${z}: ${String(error)}`, { cause: error });
  }
}

/** A target, slower where it leads uphill from a place. */
export function slowed(
  [x, z, facing]: Target,
  root: Target,
  ground: GroundHeight,
  settings: Numbers,
): Target {
  const way = settings.slope_span / Math.max(Math.hypot(x, z), 1e-9);
  const rise = ground(root[0] + way * x, root[1] + way * z) - ground(root[0], root[1]);
  const slower = 1 + (settings.uphill * Math.max(rise, 0)) / settings.slope_span;
  return [x / slower, z / slower, facing];
}

/** Put a pose on the ground, a tick later. */
export function grounded(
  terrain: Terrain,
  pose: Played,
  ground: GroundHeight,
  settings: Numbers,
  seconds: number,
): void {
  const [x, z, facing] = pose.ground;
  const place: Vector = [x, pose.height, z];
  const hipsTurn = product(about(Y, facing), turnAt(pose.rotations, 0));
  const isNew = !terrain.place;
  const before = terrain.place ?? [x, z];
  const velocity: [number, number] = [(x - before[0]) / seconds, (z - before[1]) / seconds];
  terrain.place = [x, z];
  // feet: tilted to the slope under them, and raised to the ground, or in time for an edge
  const legs = terrain.feet.map((foot, side): Leg => {
    const limb = legOf(pose.rotations, side, hipsTurn, place);
    const stands = pose.contacts[side]! > settings.stands;
    return stepped(foot, isNew, limb, place, velocity, stands, ground, settings, seconds);
  });
  // hips: as high as the lower foot lets them
  const lowerFoot = Math.min(...legs.map(({ height }) => height));
  const goal = Math.min(...legs.map((leg) => hipsGoal(leg, lowerFoot, settings)));
  terrain.hips = followed(terrain.hips, goal, isNew, settings.hips, seconds);
  // legs: reach from the raised hips for the raised ankles
  legs.forEach(({ limb, ankle, height }, side) => {
    const move = minus(plus(ankle, [0, height - terrain.hips[0], 0]), limb.places[2]);
    reach(pose.rotations, side, hipsTurn, limb, move);
  });
  pose.height += terrain.hips[0];
}

/** A foot a tick later. */
function stepped(
  foot: Foot,
  isNew: boolean,
  limb: Limb,
  hips: Vector,
  [x, z]: [number, number],
  stands: boolean,
  ground: GroundHeight,
  settings: Numbers,
  seconds: number,
): Leg {
  const flat = solePoints(limb);
  const ball = flat[1]!;
  const ankle = limb.places[2];
  // tilt: it turns about its ball
  const under = slopeUnder(flat, ground, settings);
  foot.slope = foot.slope.map((slope, axis) =>
    followed(slope, under[axis]!, isNew, settings.tilt, seconds),
  ) as Foot["slope"];
  const tilt = swing(Y, [-foot.slope[0][0], 1, -foot.slope[1][0]]);
  const tilted = (point: Vector) => plus(ball, rotated(tilt, minus(point, ball)));
  const sole = flat.map(tilted);
  // how much it has to be raised to be as high above the ground somewhere as above the plane
  const clearance = Math.min(...flat.map((point) => point[1]));
  const raised = (time: number) =>
    clearance + Math.max(...sole.map((point) => ground(point[0] + time * x, point[2] + time * z) - point[1]));
  const here = raised(0);
  // before an edge it climbs no more steeply than it can
  const swings = stands ? 0 : settings.swings;
  let climbing = here;
  for (let glance = 1; glance <= TERRAIN.GLANCES; glance++) {
    const time = (swings * settings.foresees * glance) / TERRAIN.GLANCES;
    climbing = Math.max(climbing, raised(time) - settings.climbs * time * Math.hypot(x, z));
  }
  const [value, rate] = followed(foot.height, climbing, isNew, settings.feet, seconds);
  foot.height = [Math.max(value, here), rate];
  // the share of its swing that it has made, by how far it is behind or ahead of the hips
  const along = (ankle[0] - hips[0]) * x + (ankle[2] - hips[2]) * z;
  const ahead = along / Math.max(x * x + z * z, TERRAIN.LEAST_SQUARED_SPEED);
  const swung = clamp(0.5 + ahead / (2 * settings.half_step), 0, 1);
  const [thigh, shin, flatFoot, toes] = limb.turned;
  return {
    limb: { turned: [thigh, shin, product(tilt, flatFoot), toes], places: limb.places },
    stands,
    swung,
    ankle: tilted(ankle),
    height: foot.height[0],
    landing: raised(swings * (1 - swung) * 2 * settings.half_step),
  };
}

/** A number a tick later on its way to a goal; of a new figure it is there. */
function followed(
  [value, rate]: Moving,
  goal: number,
  isNew: boolean,
  halfLife: number,
  seconds: number,
): Moving {
  if (isNew) return [goal, 0];
  const [off, slower] = damped(value - goal, rate, dampingOf(halfLife), seconds);
  return [goal + off, slower];
}

/** The slope under the middle of a foot, rise along x and along z; none where that is an edge. */
function slopeUnder([heel, ball]: Vector[], ground: GroundHeight, settings: Numbers): [number, number] {
  const x = (heel![0] + ball![0]) / 2;
  const z = (heel![2] + ball![2]) / 2;
  const { spread } = settings;
  const alongX = (ground(x + spread, z) - ground(x - spread, z)) / (2 * spread);
  const alongZ = (ground(x, z + spread) - ground(x, z - spread)) / (2 * spread);
  const isEdge = Math.hypot(alongX, alongZ) > Math.tan((settings.steepest * Math.PI) / 180);
  return isEdge ? [0, 0] : [alongX, alongZ];
}

/** How much a leg lets the hips be raised. */
function hipsGoal(
  { limb, stands, swung, ankle, height, landing }: Leg,
  lowerFoot: number,
  settings: Numbers,
): number {
  // hips sink to where a swinging foot lands, as far as it has swung
  if (!stands) return lowerFoot + swung * Math.min(landing - lowerFoot, 0);
  // a foot that stands lets them be as high as its leg reaches, straight at most or as it is on the plane
  const [hip, knee, flat] = limb.places;
  const longest = settings.straight * (size(minus(knee, hip)) + size(minus(flat, knee)));
  const longestReach = Math.max(longest, size(minus(flat, hip)));
  const [x, y, z] = minus(ankle, hip);
  const spare = y + Math.sqrt(Math.max(longestReach * longestReach - (x * x + z * z), 0));
  return height + Math.min(spare, 0);
}
