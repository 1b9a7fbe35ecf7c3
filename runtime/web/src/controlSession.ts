/* A session of steered figures: commands in, within what gaits allow, and a pose a tick out. */
import { doing, type Doing, noAct } from "./acting.js";
import { type Act, actOf, numbersOf } from "./acts.js";
import type { ControlModel } from "./control.js";
import { ControlError } from "./errors.js";
import { newLock } from "./footLock.js";
import { type Command, told } from "./gaits.js";
import { BONES } from "./humanoid.js";
import type { Target } from "./matching.js";
import type { Motion } from "./motion.js";
import type { Pose } from "./poses.js";
import { about, product, type Quaternion, Y } from "./rotations.js";
import { wrapped } from "./springs.js";
import { hasten, standing, type Steered, tell, tick } from "./steered.js";
import { between, type Played } from "./steering.js";

/** A number of a command at most: metres, m/s, degrees. */
const LARGEST = 1e6;
const RADIANS = Math.PI / 180;

/** A pose as `posesOf` gives it, and where its figure is. */
export interface SteeredPose extends Pose {
  /** x and z in metres, and the facing in radians: 0 along z, positive to the left. */
  ground: [x: number, z: number, facing: number];
  /** From 0 to 1, how much the left and the right foot stand. */
  contacts: [left: number, right: number];
}

/** A value for all figures, or one for each. */
export type ForAll<T> = T | readonly T[];

/** Where figures go from now on; what is not given stays. Angles are in degrees. */
export interface Told {
  /** One of `model.gaits`. */
  gait?: ForAll<string>;
  /** m/s. */
  speed?: ForAll<number>;
  /** Of travel. */
  direction?: ForAll<number>;
  /** If only the direction is given, they face it. */
  facing?: ForAll<number>;
  /** Along x and z in m/s, such as from a gamepad's stick, in place of speed and direction; [0, 0] stops. */
  velocity?: readonly number[] | readonly (readonly number[])[];
}

interface State {
  figures: Steered[];
  /** The last two ticks, between which `advance` shows a pose, and how far it is. */
  shown: [Played[], Played[]] | null;
  ahead: number;
}

/** The whole state of a session. */
export interface ControlSnapshot {
  readonly holdFeet: boolean;
  readonly state: unknown;
}

/** Figures that move together, each steered separately. Angles are degrees about the vertical: 0 along z, positive to the left. */
export class ControlSession {
  private state: State;
  private readonly said = new Set<number>();

  constructor(
    readonly model: ControlModel,
    gait: number,
    readonly characters: number,
    private readonly holdFeet: boolean,
    private readonly strict: boolean,
    phases: readonly number[] | null,
  ) {
    const figures = Array.from({ length: characters }, (_, at) => standing(model, gait, undefined, phases?.[at]));
    this.state = { figures, shown: null, ahead: 0 };
  }

  /** Of each figure the velocity along x and z, m/s, and the facing, radians, within the limits of its gait. */
  get targets(): Target[] {
    return this.state.figures.map(({ target }) => [...target]);
  }

  /**
   * Set where the figures go from now on. A speed outside a gait's range is clamped and the console warned once, or
   * refused if the session is strict. ControlError for what does not fit; nothing changes then.
   */
  control({ gait, speed, direction, facing, velocity }: Told): void {
    const gaits = gait === undefined ? undefined : this.gaits(gait);
    const speeds = this.each("speed", speed);
    const [directions, facings] = [this.each("direction", direction), this.each("facing", facing)];
    const moves = velocity === undefined ? undefined : this.rows("a velocity", velocity, ["x", "z"]);
    if (moves && (speeds || directions)) throw new ControlError("give a velocity, or speed and direction, not both");
    const commands = this.state.figures.map(({ command }, at) => {
      const given: Partial<Command> = {};
      if (gaits) given.gait = gaits[at]!;
      if (facings) given.facing = facings[at]! * RADIANS;
      if (moves) return byVelocity(command, given, moves[at]!);
      if (speeds) given.speed = speeds[at]!;
      if (directions) given.direction = directions[at]! * RADIANS;
      return told(command, given);
    });
    this.tell(commands);
  }

  private tell(commands: Command[]): void {
    const found = commands.map((command) => this.model.abilities.target(command));
    found.forEach(({ beyond }, at) => {
      if (beyond && this.strict) throw new ControlError(beyond);
      if (beyond && !this.said.has(commands[at]!.gait)) {
        this.said.add(commands[at]!.gait);
        console.warn(beyond);
      }
    });
    this.state.figures.forEach((figure, at) => tell(figure, commands[at]!, found[at]!.target));
  }

  /**
   * Do something, from the next tick on, in place of what is being done: a motion of any human figure, or an act that
   * `actOf` made of one, or null to end what is done; one for all, or one for each of `who`, the numbers of the figures. upper: by the upper body alone,
   * or by the whole body with its own way over the ground; if neither is said, by the whole body where a figure stands, whose
   * legs go as soon as it is told to. ControlError for figures that are not there, MotionError for what is no human's.
   */
  act(what: Motion | Act | null | readonly (Motion | Act | null)[], { who, upper }: { who?: readonly number[]; upper?: boolean } = {}): void {
    const figures = who ?? this.state.figures.map((_, at) => at);
    if (!figures.every((at) => Number.isInteger(at) && at >= 0 && at < this.characters)) throw new ControlError(`figures are whole numbers from 0 to ${this.characters - 1}, not ${figures.join(", ")}`);
    const given = (Array.isArray(what) ? what : Array<typeof what>(figures.length).fill(what)) as (Motion | Act | null)[];
    if (given.length !== figures.length) throw new ControlError(`${given.length} acts do not fit ${figures.length} figures`);
    const made = new Map([...new Set(given)].map((one) => [one, one && "skeleton" in one ? actOf(this.model, "act", numbersOf(this.model, one)) : one]));
    figures.forEach((at, i) => (this.state.figures[at]!.acting.asked = { act: made.get(given[i]!)!, upper }));
  }

  /** Of each figure what it does, and the seconds that are left of it; null of one that only stands or goes. */
  get acting(): (Doing | null)[] {
    return this.state.figures.map(({ acting }) => doing(acting, this.model.fps));
  }

  /** The next pose of each figure, 1 / fps seconds later. */
  tick(): SteeredPose[] {
    return this.played().map(poseOf);
  }

  /** A tick with targets that are not checked: of each figure the velocity along x and z in m/s, and the facing in radians. */
  tickTo(targets: Target[]): SteeredPose[] {
    return this.played(targets).map(poseOf);
  }

  private played(targets?: Target[]): Played[] {
    return this.state.figures.map((figure, at) => tick(this.model, figure, this.holdFeet, targets?.[at]));
  }

  /** The poses `seconds` later, 0 to 1, for a display of any frame rate: between two ticks. A command shows within a tick. */
  advance(seconds: number): SteeredPose[] {
    if (!(seconds >= 0 && seconds <= 1)) throw new ControlError(`a session advances by 0 to 1 s, not ${seconds}`);
    const { state } = this;
    state.shown ??= [this.played(), this.played()];
    state.ahead += seconds * this.model.fps;
    for (; state.ahead >= 1; state.ahead--) state.shown = [state.shown[1], this.played()];
    const [before, after] = state.shown;
    return before.map((pose, at) => poseOf(between(pose, after[at]!, state.ahead)));
  }

  /** Push the figures by a velocity along x and z, m/s, from which they recover. */
  push(velocity: readonly number[] | readonly (readonly number[])[]): void {
    const rows = this.rows("a velocity", velocity, ["x", "z"]);
    this.state.figures.forEach(({ playback }, at) => {
      const [x, z, facing] = playback.spring;
      playback.spring = [x + rows[at]![0]!, z + rows[at]![1]!, facing];
      hasten(playback);
    });
  }

  /** Place the figures elsewhere: x and z in metres, facing in degrees. */
  put(places: readonly number[] | readonly (readonly number[])[]): void {
    this.rows("places", places, ["x", "z", "facing"]).forEach(([x, z, degrees], at) => {
      const figure = this.state.figures[at]!;
      const { playback, command } = figure;
      const facing = wrapped(degrees! * RADIANS);
      playback.root = [x!, z!, facing];
      playback.spring = [playback.spring[0], playback.spring[1], facing];
      const direction = command.speed > 0 ? command.direction : facing; // standing ones move the way they face
      figure.command = { ...command, direction, facing, facesWay: false };
      figure.target = this.model.abilities.target(figure.command).target;
      figure.lock = newLock();
      figure.acting = noAct(this.model, playback);
    });
    this.state.shown = null; // nothing lies between there and here
  }

  /** The whole state, to be restored later. */
  snapshot(): ControlSnapshot {
    return { holdFeet: this.holdFeet, state: structuredClone(this.state) };
  }

  /** Go back to a snapshot of this session or of one like it; ControlError for another. */
  restore(snapshot: ControlSnapshot): void {
    const state = snapshot.state as State;
    if (state.figures.length !== this.characters) {
      throw new ControlError(`a snapshot of ${state.figures.length} characters does not fit ${this.characters}`);
    }
    if (snapshot.holdFeet !== this.holdFeet) throw new ControlError("a snapshot with held feet fits no session without them, nor the other way round");
    this.state = structuredClone(state);
  }

  private gaits(given: ForAll<string>): number[] {
    const names = Array.isArray(given) ? (given as string[]) : Array<string>(this.characters).fill(given as string);
    if (names.length !== this.characters) throw new ControlError(`${names.length} gaits do not fit ${this.characters} characters`);
    return names.map((name) => this.model.abilities.number(name));
  }

  /** A number for each figure; none if none is given. */
  private each(name: string, given?: ForAll<number>): number[] | undefined {
    if (given === undefined) return undefined;
    const values = (Array.isArray(given) ? given : [given]) as number[];
    return this.rows(name, values.map((value) => [value]), [name]).map(([value]) => value!);
  }

  /** A row of numbers for each figure, of one for all or one for each. */
  private rows(what: string, given: readonly number[] | readonly (readonly number[])[], columns: string[]): readonly (readonly number[])[] {
    const rows = (Array.isArray(given?.[0]) ? given : [given]) as readonly (readonly number[])[];
    const fits = rows.every((row) => row?.length === columns.length) && (rows.length === 1 || rows.length === this.characters);
    if (!fits) throw new ControlError(`${what} needs ${columns.join(", ")}, for all or for each of ${this.characters} characters`);
    if (!rows.every((row) => Array.from(row).every((value) => typeof value === "number" && Math.abs(value) <= LARGEST))) {
      throw new ControlError(`${what} must be finite numbers, no larger than ${LARGEST}`);
    }
    return rows.length === this.characters ? rows : Array<readonly number[]>(this.characters).fill(rows[0]!);
  }
}

/** A command with a velocity; one that stops leaves the direction, and how the figure faces. */
function byVelocity(command: Command, given: Partial<Command>, [x, z]: readonly number[]): Command {
  const speed = Math.hypot(x!, z!);
  const found = told(command, { ...given, speed, direction: speed > 0 ? Math.atan2(x!, z!) : command.direction });
  return given.facing === undefined ? { ...found, facesWay: command.facesWay || speed > 0 } : found;
}

function poseOf({ ground, rotations: own, height, contacts }: Played): SteeredPose {
  const rotations: Record<string, Quaternion> = {};
  for (let at = 0; at < BONES.length; at++) rotations[BONES[at]!] = own[at]!;
  rotations.hips = product(about(Y, ground[2]), own[0]!);
  return { hips: [ground[0], height, ground[1]], rotations, ground: [...ground], contacts };
}
