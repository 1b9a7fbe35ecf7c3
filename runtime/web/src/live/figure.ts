/* The model of a live page, and its figures. */
import { doing, type Doing } from "../steering/actionLayer.js";
import { type Act, motionOf } from "../steering/acts.js";
import { ControlModel } from "../steering/model.js";
import type { Manifest } from "../bundle/bundle.js";
import { HUMANOID, SIDES } from "../figures/humanoid/bones.js";
import { type Going, lead, type Point, restingPlace } from "../steering/paths.js";
import type { Tables } from "../steering/matching.js";
import { worldOf } from "../motion/motion.js";
import type { Pose as Ground } from "../motion/planar.js";
import type { Quaternion, Vector } from "../motion/rotations.js";
import { damped, dampedPath, dampingOf, wrapped } from "../motion/springs.js";
import { landscape } from "./landscape.js";
import { type Packed, unpacked } from "../bundle/packing.js";
import { standing, type Steered, tell, tick } from "../steering/steered.js";
import { between, copyPose, newPose, type Played } from "../steering/step.js";

export { motionOf };

/** Joints of the foot and of the toes, left and right. */
export const FEET = SIDES.map((side) => ["Foot", "Toes"].map((part) => HUMANOID.index(side + part)));

/** The numbers of a bundle, as motet/live/page.py writes them. */
export interface Given extends Packed {
  manifest: Manifest;
}

/** Where a figure goes: which gait, its velocity along x and z in m/s, and its facing in radians. */
export interface Asked {
  gait: number;
  x: number;
  z: number;
  facing: number;
}

/** The model of a page. */
export async function modelOf(embedded: Given): Promise<ControlModel> {
  return new ControlModel(embedded.manifest, (await unpacked(embedded)) as unknown as Tables);
}

/** A figure of the page, and the last two ticks, between which it is shown. */
export class Figure {
  private readonly steered: Steered;
  private before = newPose();
  private now = newPose();

  /** With a phase it searches in its turn alone: a crowd costs the same in each tick. */
  constructor(
    private readonly model: ControlModel,
    place: Ground,
    phase?: number,
  ) {
    this.steered = standing(model.steerer, 0, place, phase);
    const pose = tick(model, this.steered, true, landscape);
    copyPose(this.before, pose);
    copyPose(this.now, pose);
  }

  /** x and z in metres, and the facing in radians. */
  get root(): Ground {
    return this.steered.playback.root;
  }

  /** Along x and z in m/s. */
  get velocity(): [x: number, z: number] {
    const [x, z] = this.steered.playback.spring;
    return [x, z];
  }

  /** Where it comes to rest if it is to stand from now on. */
  get restingPlace(): Point {
    return restingPlace(this.steered.playback, this.model.steerer.matcher.settings.velocity);
  }

  get goes(): boolean {
    return Math.hypot(...this.velocity) > 0.1;
  }

  /** What it was asked, within the limits of its gait. */
  get wanted(): Asked {
    const [x, z, facing] = this.steered.target;
    return { gait: this.steered.command.gait, x, z, facing };
  }

  /** A tick later, asked anew or led along a path. */
  tick(command: Asked | Going): void {
    if ("points" in command) this.lead(command);
    else this.tell(command);
    const { before, now } = this;
    this.before = now;
    this.now = before;
    copyPose(this.now, tick(this.model, this.steered, true, landscape));
  }

  private tell({ gait, x, z, facing }: Asked): void {
    const command = { gait, speed: Math.hypot(x, z), direction: Math.atan2(x, z), facing, facesWay: false };
    tell(this.steered, command, this.model.abilities.target(command).target);
  }

  private lead(going: Going): void {
    this.steered.going = going;
    lead(this.model, [this.steered], 0);
  }

  /** Do something, from the next tick on, or null: end what it does. `upper` as in a session's `act`. Meanwhile a whole body faces as the act does. */
  act(act: Act | null, upper?: boolean): void {
    this.steered.acting.request = { act, upper };
  }

  /** The number of the style in which it goes from now on. */
  set style(number: number) {
    this.steered.style.wanted = number;
  }

  /** What it does, and the seconds that are left of it. */
  get acting(): Doing | null {
    return doing(this.steered.acting, this.model.fps);
  }

  /** Where it is asked to be so many seconds from now: what its springs lead to. */
  later(seconds: number): Ground {
    const { playback, target } = this.steered;
    const { root, spring, springRate } = playback;
    const { velocity, facing } = this.model.steerer.matcher.settings;
    const slow = dampingOf(velocity);
    const [x, z] = [0, 1].map(
      (i) =>
        root[i]! + target[i]! * seconds + dampedPath(spring[i]! - target[i]!, springRate[i]!, slow, seconds),
    );
    const [off] = damped(wrapped(spring[2] - target[2]), springRate[2], dampingOf(facing), seconds);
    return [x!, z!, target[2] + off];
  }

  /** The pose of the last tick. */
  get pose(): Played {
    return this.now;
  }

  /** As it is at a part of the way from the last tick but one to the last. */
  shown(part: number): Shown {
    return shownOf(between(this.before, this.now, part));
  }
}

/** A pose with rotations and places in the world of the humanoid's joints. */
export interface Shown extends Played {
  turned: Quaternion[];
  places: Vector[];
}

/** A pose in the world. */
export function shownOf(pose: Played): Shown {
  const { turns, places } = worldOf(motionOf([pose]));
  return { ...pose, turned: turns[0]!, places: places[0]! };
}

/** A speed that a gait has at an angle from the facing; 0 is always one. */
export function inRange({ abilities }: ControlModel, gait: number, speed: number, aside = 0): number {
  const [x, z] = abilities.target({ gait, speed, direction: aside, facing: 0, facesWay: false }).target;
  return Math.hypot(x, z);
}
