/* Which points of feet stand, and the path over the ground that feet imply: docs/reference/retargeting.md, "Clips in place". */
import { CONTACTS, treadmillSettings } from "../../generated.js";
import { rise, rounded, smoothed } from "../../motion/numbers.js";
import type { Vector } from "../../motion/rotations.js";

/** x and z by frame. */
export type Plane = [x: number, z: number][];

/** Contact of each point from each frame to the next, 0 to 1: low and slow. */
export function contacts(points: Vector[][], fps: number): number[][] {
  const rows = points.map((frame) => frame.flatMap(([x, , z]) => [x, z]));
  const calm = smoothed(rows, CONTACTS.SOLES.calm * fps);
  return points.slice(1).map((frame, at) =>
    frame.map((point, k) => {
      const [x, z] = [2 * k, 2 * k + 1].map((column) => calm[at + 1]![column]! - calm[at]![column]!);
      const speed = Math.hypot(x!, z!) * fps;
      const height = (point[1] + points[at]![k]![1]) / 2;
      return (1 - rise(height, ...CONTACTS.SOLES.heights)) * (1 - rise(speed, ...CONTACTS.SOLES.speeds));
    }),
  );
}

/** Velocities over the ground, in m/s from each frame to the next, that keep points (T, K) from sliding; heights: of them over the ground. */
export function velocityByFeet(points: Plane[], heights: number[][], fps: number): Plane {
  const rows = points.map((row) => row.flat());
  const calm = smoothed(rows, treadmillSettings.calm * fps);
  const steps = calm.slice(1).map((row, at) => row.map((value, i) => (calm[at]![i]! - value) * fps));
  const votes = steps.map((row) =>
    heights[0]!.map((_, k): [number, number] => [row[2 * k]!, row[2 * k + 1]!]),
  );
  const near = votes.map((row, at) =>
    row.map((_, k) => 1 - rise((heights[at]![k]! + heights[at + 1]![k]!) / 2, 0, CONTACTS.VOTING_HEIGHT)),
  );
  let velocity = led(votes, near, fps);
  for (let round = 0; round < CONTACTS.REWEIGHTINGS; round++) {
    const weights = votes.map((row, at) =>
      row.map((vote, k) => near[at]![k]! * agreement(vote, velocity[at]!)),
    );
    velocity = led(votes, weights, fps);
  }
  return velocity;
}

/** How far a vote counts beside a velocity. */
function agreement([x, z]: [number, number], [alongX, alongZ]: [number, number]): number {
  const offX = x - alongX;
  const offZ = z - alongZ;
  const allowed = CONTACTS.ALLOWED[offX * alongX + offZ * alongZ > 0 ? 0 : 1];
  return (1 + (offX ** 2 + offZ ** 2) / allowed ** 2) ** -2;
}

/** The weighted mean of all votes, those of near frames more. */
function led(votes: Plane[], weights: number[][], fps: number): Plane {
  const sums = votes.map((row, at) => {
    const sum = (of: (vote: [number, number]) => number) =>
      row.reduce((all, vote, k) => all + weights[at]![k]! * of(vote), 0);
    return [sum(() => 1), sum(([x]) => x), sum(([, z]) => z)] as const;
  });
  const reach = rounded(CONTACTS.VOTING_SECONDS * fps);
  const nearness = Array.from({ length: reach + 1 }, (_, away) =>
    Math.exp(-away / (CONTACTS.VOTE_DECAY_SECONDS * fps)),
  );
  return sums.map((_, at) => {
    let total = 1e-12;
    let x = 0;
    let z = 0; // no vote within a second is none
    for (let other = Math.max(0, at - reach); other <= Math.min(sums.length - 1, at + reach); other++) {
      const near = nearness[Math.abs(other - at)]!;
      total += near * sums[other]![0];
      x += near * sums[other]![1];
      z += near * sums[other]![2];
    }
    return [x / total, z / total];
  });
}

/** Heights of the root in metres: those that put the feet on the ground, or more in flight, where it falls freely. */
export function heightsByFeet(standing: number[], fps: number): number[][] {
  // a jump up forward in time is a fall backward: only frames on which both agree are flight
  const up = flown(standing, fps);
  const down = flown([...standing].reverse(), fps).reverse();
  const both = up.map((value, at) => [Math.min(value, down[at]!)]);
  return smoothed(both, treadmillSettings.calm * fps);
}

function flown(standing: number[], fps: number): number[] {
  const heights = [...standing];
  const span = Math.max(1, rounded(CONTACTS.RISE_SPAN * fps));
  let speed = 0;
  for (let at = 1; at < heights.length; at++) {
    const falling = heights[at - 1]! + speed / fps - (0.5 * CONTACTS.GRAVITY) / fps ** 2;
    if (falling > heights[at]!) {
      // in flight: the feet would have to go down faster than it falls
      heights[at] = falling;
      speed -= CONTACTS.GRAVITY / fps;
    } else {
      // on the ground, where the next flight begins with the speed of the last frames
      const start = Math.max(0, at - span);
      speed = ((heights[at]! - heights[start]!) * fps) / (at - start);
    }
  }
  return heights;
}
