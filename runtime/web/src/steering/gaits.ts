/* What a figure can be asked: gaits with their speeds, and commands within them. Metres a second and radians. */
import { steeringSettings } from "../generated.js";
import { ControlError } from "../errors.js";
import type { Target } from "./matching.js";
import { clamp, wrapped } from "../motion/springs.js";
import type { Settings } from "../settings.js";

/** The slowest, the usual, and the fastest speed forward, sideways and backwards; 0 where a gait cannot go that way. */
export type Speeds = readonly [
  slowest: number,
  usual: number,
  forward: number,
  sideways: number,
  backwards: number,
];

/** The last command to a figure. */
export interface Command {
  gait: number;
  speed: number;
  /** Of travel. */
  direction: number;
  facing: number;
  /** Whether it is to face the way it moves. */
  facesWay: boolean;
}

export class Gaits {
  constructor(
    readonly names: readonly string[],
    readonly speeds: readonly Speeds[],
    private readonly settings: Settings<typeof steeringSettings>,
  ) {}

  /** The number of a gait; ControlError for an unknown one. */
  number(name: string): number {
    const gait = this.names.indexOf(name);
    if (gait < 0)
      throw new ControlError(
        `unknown gait ${JSON.stringify(name)}; expected one of ${this.names.join(", ")}`,
      );
    return gait;
  }

  /** A facing from which a gait goes in a direction: not all go sideways and backwards. */
  facing(gait: number, direction: number, facing: number): number {
    const [, , , sideways, backwards] = this.speeds[gait]!;
    const farthest = Math.min(sideways, backwards) > 0 ? Math.PI : this.settings.ahead;
    return direction - clamp(wrapped(direction - facing), -farthest, farthest);
  }

  /** A target as a figure with a facing goes for it: a gait that only goes forward leads and turns no farther aside than it
   *  goes anyway, so that the figure goes a curve instead of turning on the spot. */
  curved([x, z, to]: Target, gait: number, facing: number): Target {
    const [, , , sideways, backwards] = this.speeds[gait]!;
    if (Math.min(sideways, backwards) > 0 || !(x || z)) return [x, z, to];
    const near = (angle: number) =>
      facing + clamp(wrapped(angle - facing), -this.settings.ahead, this.settings.ahead);
    const direction = near(Math.atan2(x, z));
    const speed = Math.hypot(x, z);
    return [speed * Math.sin(direction), speed * Math.cos(direction), near(to)];
  }

  /** A command's target within the gait's limits, and what is said where it exceeds them. */
  target({ gait, speed, direction, facing: wanted }: Command): { target: Target; beyond: string | null } {
    const [slowest, , ...fastest] = this.speeds[gait]!;
    const facing = speed > 0 ? this.facing(gait, direction, wanted) : wanted;
    const aside = Math.abs(wrapped(direction - facing));
    const high = fastest[[this.settings.aside, this.settings.back].filter((edge) => aside >= edge).length]!;
    const low = Math.min(slowest, high);
    const within = speed > 0 ? clamp(speed, low, high) : 0;
    const limits = `${JSON.stringify(this.names[gait])} allows 0 or ${low}-${high} m/s in this direction, not ${speed}`;
    const target: Target = [within * Math.sin(direction), within * Math.cos(direction), wrapped(facing)];
    return { target, beyond: Math.abs(within - speed) > 1e-6 ? limits : null };
  }
}

/** A command with what is told anew. Given a direction but no facing, the figure faces it once it moves. */
export function changed(command: Command, changes: Partial<Omit<Command, "facesWay">>): Command {
  const faces =
    changes.direction !== undefined || changes.facing !== undefined
      ? changes.facing === undefined
      : command.facesWay;
  const next = { ...command, ...changes, facesWay: faces };
  return { ...next, facing: faces && next.speed > 0 ? next.direction : next.facing };
}
