/* A session of steered figures: commands in, within what gaits allow, and a pose a tick out. */
import { CONTROL, TARGETS } from "../generated.js";
import { doing, type Doing, noAct } from "./actionLayer.js";
import { type Act, actOf, numbersOf } from "./acts.js";
import type { ControlModel, StartSettings } from "./model.js";
import { ControlError } from "../errors.js";
import { after, eventsOf, type FigureEvent } from "./events.js";
import { newLock } from "./footLock.js";
import { type Command, changed } from "./gaits.js";
import { BONES, SIDES } from "../figures/humanoid/bones.js";
import { lead, type Point, restingPlace, sent } from "./paths.js";
import type { Target } from "./matching.js";
import type { Motion } from "../motion/motion.js";
import type { Pose } from "../representation/poses.js";
import { about, product, type Quaternion, RADIANS, turnAt, type Vector, Y } from "../motion/rotations.js";
import { wrapped } from "../motion/springs.js";
import { hasten, standing, type Steered, tell, tick } from "./steered.js";
import { between, copyPose, newPose, type Played } from "./step.js";
import { STYLE_NAMES, styleNumber } from "./styleLayer.js";
import { checkedGround, type GroundHeight, newTerrain } from "./terrain.js";

/** A pose as `posesOf` gives it, and where its figure is. */
export interface SteeredPose extends Pose {
  /** x and z in metres, and the facing in radians: 0 along z, positive to the left. */
  ground: [x: number, z: number, facing: number];
  /** From 0 to 1, how much the left and the right foot stand. */
  contacts: [left: number, right: number];
  /** What has happened to it since the pose before. */
  events: FigureEvent[];
}

/** What can be acted; null ends it. */
export type Doable = Motion | Act | string | null;

/** A value for all figures, or one for each. */
export type ForAll<T> = T | readonly T[];

/** Numbers for all figures, or a row for each. */
export type Rows = readonly number[] | readonly (readonly number[])[];

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
  velocity?: Rows;
  /** One of `model.styles`, such as "limping", in which they go and stand, at the same speed and on their ways; "none" ends it. */
  style?: ForAll<string>;
}

/** How figures go to points. Angles are in degrees. */
export interface Way {
  /** At the end; by default as they come. */
  facing?: ForAll<number>;
  /** By default the one that they have. */
  gait?: string;
  /** m/s, by default the gait's usual one. */
  speed?: ForAll<number>;
  /** The numbers of the figures that are meant, by default all. */
  ids?: readonly number[];
}

/** Of a tick, and what has happened since the one before. */
interface Ticked {
  pose: Played;
  events: FigureEvent[];
}

interface State {
  figures: Steered[];
  /** Metres that figures keep apart, 0 for none. */
  room: number;
  /** The last two ticks, between which `advance` shows a pose, and how far it is. */
  shown: [Ticked[], Ticked[]] | null;
  ahead: number;
  /** Of each figure what happened in a tick that was to be shown next, when figures were put elsewhere. */
  late: FigureEvent[][];
}

/** The whole state of a session. */
export interface ControlSnapshot {
  readonly holdFeet: boolean;
  readonly state: unknown;
}

/** Figures that move together, each steered separately. Angles are degrees about the vertical: 0 along z, positive to the left. */
export class ControlSession {
  private state: State;
  private readonly warned = new Set<number>();
  private ground: GroundHeight | null = null;

  constructor(
    readonly model: ControlModel,
    gait: number,
    characters: number,
    private readonly holdFeet: boolean,
    private readonly strict: boolean,
    phases: readonly number[] | null,
  ) {
    const figures = Array.from({ length: characters }, (_, at) =>
      standing(model.steerer, gait, undefined, phases?.[at]),
    );
    this.state = { figures, room: 0, shown: null, ahead: 0, late: figures.map(() => []) };
  }

  get characters(): number {
    return this.state.figures.length;
  }

  /** Of each figure the velocity along x and z, m/s, and the facing, radians, within the limits of its gait. */
  get targets(): Target[] {
    return this.state.figures.map(({ target }) => [...target]);
  }

  /**
   * Set where the figures go from now on. A speed outside a gait's range is clamped and the console warned once, or
   * refused if the session is strict. ControlError for what does not fit; nothing changes then.
   */
  control({ style, ...orders }: Told): void {
    const { gait, speed, direction, facing, velocity } = orders;
    const gaits = gait === undefined ? undefined : this.gaits(gait);
    const styles = style === undefined ? undefined : this.forEach("styles", style).map(styleNumber);
    const speeds = this.each("speed", speed);
    const directions = this.each("direction", direction);
    const facings = this.each("facing", facing);
    const moves = velocity === undefined ? undefined : this.rows("a velocity", velocity, ["x", "z"]);
    if (moves && (speeds || directions))
      throw new ControlError("give a velocity, or speed and direction, not both");
    const commands = this.state.figures.map(({ command }, at) => {
      const changes: Partial<Command> = {};
      if (gaits) changes.gait = gaits[at]!;
      if (facings) changes.facing = facings[at]! * RADIANS;
      if (moves) return byVelocity(command, changes, moves[at]!);
      if (speeds) changes.speed = speeds[at]!;
      if (directions) changes.direction = directions[at]! * RADIANS;
      return changed(command, changes);
    });
    // a style alone leaves them on their ways
    if (Object.values(orders).some((value) => value !== undefined)) this.tell(commands);
    styles?.forEach((number, at) => (this.state.figures[at]!.style.wanted = number));
  }

  /** The style of each figure, "none" of those that go as recorded. */
  get styles(): string[] {
    return this.state.figures.map(({ style }) => STYLE_NAMES[style.wanted]!);
  }

  private tell(commands: Command[]): void {
    const targets = commands.map((command) => this.model.abilities.target(command));
    targets.forEach(({ beyond }, at) => {
      if (beyond && this.strict) throw new ControlError(beyond);
      if (beyond && !this.warned.has(commands[at]!.gait)) {
        this.warned.add(commands[at]!.gait);
        console.warn(beyond);
      }
    });
    this.state.figures.forEach((figure, at) => tell(figure, commands[at]!, targets[at]!.target));
  }

  /**
   * Do something, from the next tick on, in place of what is being done: a motion of any human figure, or an act that
   * `actOf` made of one, or the name of a gait that goes nowhere, such as "jump", done once and forward by who moves, or null to
   * end what is done; one for all, or one for each of `ids`, the numbers of the figures. upper: by the upper body alone, or by
   * the whole body with its own way over the ground; if neither is said, by the whole body where a figure stands, whose legs go as
   * soon as it is told to, or where the act is one of the legs, such as a kick, after which a figure that moves goes on.
   * ControlError for figures that are not there and gaits that have no such act, MotionError for what is no human's.
   */
  act(
    what: Doable | readonly Doable[],
    { ids, upper }: { ids?: readonly number[]; upper?: boolean } = {},
  ): void {
    const figures = this.chosen(ids);
    const each = (Array.isArray(what) ? what : Array<typeof what>(figures.length).fill(what)) as Doable[];
    if (each.length !== figures.length)
      throw new ControlError(`${each.length} acts do not fit ${figures.length} figures`);
    const made = new Map(
      [...new Set(each)].map((act) => [
        act,
        act && typeof act === "object" && "skeleton" in act
          ? actOf(this.model, "act", numbersOf(this.model, act))
          : act,
      ]),
    );
    const acts = figures.map((at, i) => {
      const what = made.get(each[i]!)!;
      const [x, z] = this.state.figures[at]!.target;
      return typeof what === "string" ? this.model.take(what, !!(x || z)) : what;
    });
    figures.forEach((at, i) => (this.state.figures[at]!.acting.request = { act: acts[i]!, upper }));
  }

  /**
   * Let figures go to points on the ground and stand there: one for all, or one for each, x and z in metres; null: stand where
   * they are. They slow down to the end, and `arrived` tells when they are there; `control` ends it. ControlError for what
   * does not fit, and for a gait that goes nowhere; nothing changes then.
   */
  goTo(points: Rows | null, way: Way = {}): void {
    const figures = this.chosen(way.ids);
    const ends =
      points === null
        ? figures.map((at) => this.restingPlace(at))
        : this.rows("points", points, ["x", "z"], figures.length);
    const paths = ends.map((end) => [end]);
    this.send(figures, paths, way);
  }

  /** The same along a path, from where they are to its first point, and so on to its last: of 1 to 10,000 points, for all. */
  goAlong(path: readonly (readonly number[])[], way: Way = {}): void {
    if (!Array.isArray(path) || path.length < 1 || path.length > TARGETS.LONGEST_PATH)
      throw new ControlError(`a path needs 1 to ${TARGETS.LONGEST_PATH} points of x and z`);
    const points = path.map((point) => this.rows("points", point, ["x", "z"], 1)[0]!);
    const figures = this.chosen(way.ids);
    const paths = figures.map(() => points);
    this.send(figures, paths, way);
  }

  private send(
    figures: number[],
    paths: (readonly (readonly number[])[])[],
    { facing, gait, speed }: Way,
  ): void {
    const { abilities } = this.model;
    const facings = this.each("facing", facing, figures.length);
    const speeds = this.each("speed", speed, figures.length);
    if (speeds?.some((value) => !(value > 0)))
      throw new ControlError("speed must be above 0 m/s; points of null let figures stand");
    const gaits = figures.map((at) =>
      gait === undefined ? this.state.figures[at]!.command.gait : abilities.number(gait),
    );
    const nowhere = gaits.find((number) => !abilities.speeds[number]![2]);
    if (nowhere !== undefined)
      throw new ControlError(
        `${JSON.stringify(this.model.gaits[nowhere])} goes nowhere: give a gait such as ${JSON.stringify(this.model.gaits[0])}`,
      );
    figures.forEach((at, i) => {
      const order = {
        gait: gaits[i]!,
        speed: speeds?.[i] ?? abilities.speeds[gaits[i]!]![1],
        facing: facings ? wrapped(facings[i]! * RADIANS) : null,
      };
      const path = [this.restingPlace(at), ...(paths[i] as unknown as Point[])];
      this.state.figures[at]!.going = sent(path, order);
    });
  }

  /** Where a figure comes to rest that is to stand from now on. */
  private restingPlace(figure: number): Point {
    const { velocity } = this.model.steerer.matcher.settings;
    return restingPlace(this.state.figures[figure]!.playback, velocity);
  }

  /** Of each figure whether it stands, within 8 cm and 8 degrees, where it was told to go last. */
  get arrived(): boolean[] {
    return this.state.figures.map(({ going }) => going?.arrived ?? false);
  }

  /** Let figures that move keep `room` metres from all others, 0.1 to 5, by going around them; null: they go through each other. */
  keepApart(room: number | null = 0.8): void {
    if (room !== null && !(typeof room === "number" && room >= 0.1 && room <= 5))
      throw new ControlError(`figures keep 0.1 to 5 m apart, or null, not ${room}`);
    this.state.room = room ?? 0;
  }

  /**
   * Let figures look at points in the world from now on: one for all, or one for each, x, y and z in metres; null: ahead, as they
   * are recorded. Head, neck and upper spine share the turn, up to 85 degrees aside and 50 up or down; what is nearer to the eyes
   * than 20 cm is not looked at. ControlError for what does not fit; nothing changes then.
   */
  lookAt(points: Rows | null, { ids }: { ids?: readonly number[] } = {}): void {
    this.pointed(points, ids).forEach(([at, point]) => (this.state.figures[at]!.look.point = point));
  }

  /**
   * Let a hand of figures be at points in the world from now on, for the middle of the hand; null: as it is recorded. Only the arm
   * moves. A hand goes as near as it can to a point that is too far, and lets go of one behind the back or at the shoulder;
   * `outOfReach` tells. Otherwise like `lookAt`.
   */
  reach(hand: "left" | "right", points: Rows | null, { ids }: { ids?: readonly number[] } = {}): void {
    const side = SIDES.indexOf(hand);
    if (side < 0) throw new ControlError(`unknown hand ${JSON.stringify(hand)}; expected left or right`);
    this.pointed(points, ids).forEach(([at, point]) => (this.state.figures[at]!.hands[side]!.point = point));
  }

  /** Of each figure whether what its left and its right hand reach for was out of reach in the last tick. */
  get outOfReach(): [left: boolean, right: boolean][] {
    return this.state.figures.map(({ hands: [left, right] }) => [left.beyond, right.beyond]);
  }

  /** Numbers of figures, and a point in the world for each; null for none. */
  private pointed(points: Rows | null, numbers?: readonly number[]): [number, Vector | null][] {
    const figures = this.chosen(numbers);
    const rows = points && this.rows("points", points, ["x", "y", "z"], figures.length);
    return figures.map((at, i) => [at, rows && ([...rows[i]!] as Vector)]);
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

  /** The next pose of each figure, which is the figure's, and what happened. */
  private played(targets?: Target[]): Ticked[] {
    const { figures, room } = this.state;
    if (!targets && (room || figures.some(({ going }) => going))) lead(this.model, figures, room);
    return figures.map((figure, at) => {
      const pose = tick(this.model, figure, this.holdFeet, this.ground, targets?.[at]);
      return { pose, events: this.happened(figure, pose) };
    });
  }

  private happened(figure: Steered, pose: Played): FigureEvent[] {
    const { gaits, steerer } = this.model;
    const { happenings: before, going } = figure;
    const { gait } = figure.command;
    const { playing } = figure.acting;
    const shows = steerer.matcher.shows(figure.playback.row, gait);
    const act = playing && { name: playing.act.name, age: playing.age };
    const now = after(before, pose.contacts, gait, shows, going?.arrived ?? false, act);
    figure.happenings = now;
    return eventsOf(now, before, gaits);
  }

  /** The poses `seconds` later, 0 to 1, for a display of any frame rate: between two ticks. A command shows within a tick. */
  advance(seconds: number): SteeredPose[] {
    if (!(seconds >= 0 && seconds <= 1))
      throw new ControlError(`a session advances by 0 to 1 s, not ${seconds}`);
    const { state } = this;
    const events = state.late;
    state.late = state.figures.map(() => []);
    const pass = (ticked: Ticked[]) => ticked.forEach((figure, at) => events[at]!.push(...figure.events));
    const kept = (into?: Ticked[]) =>
      this.played().map(({ pose, events }, at): Ticked => {
        const copy = into?.[at]!.pose ?? newPose();
        copyPose(copy, pose);
        return { pose: copy, events };
      });
    if (!state.shown) {
      state.shown = [kept(), kept()];
      pass(state.shown[0]);
    }
    state.ahead += seconds * this.model.fps;
    for (; state.ahead >= 1; state.ahead--) {
      const [oldest, last]: [Ticked[], Ticked[]] = state.shown;
      pass(last);
      state.shown = [last, kept(oldest)];
    }
    const [before, next] = state.shown;
    return before.map(({ pose }, at) =>
      poseOf({ pose: between(pose, next[at]!.pose, state.ahead), events: events[at]! }),
    );
  }

  /**
   * Let the figures go over ground that is not flat, from the next tick on: its height in metres at places x and z; null: the
   * plane y = 0. Hips are then above y = 0, and uphill figures are slower. A session keeps it when it is restored. ControlError for
   * what is no function; where it fails, or gives no height, it is one of the tick.
   */
  setGround(ground: GroundHeight | null): void {
    this.ground = ground === null ? null : checkedGround(ground);
    for (const figure of this.state.figures) figure.terrain = newTerrain();
  }

  /** Push the figures by a velocity along x and z, m/s, from which they recover. */
  push(velocity: Rows): void {
    const rows = this.rows("a velocity", velocity, ["x", "z"]);
    this.state.figures.forEach(({ playback }, at) => {
      const [x, z, facing] = playback.spring;
      playback.spring = [x + rows[at]![0]!, z + rows[at]![1]!, facing];
      hasten(playback);
    });
  }

  /** Place the figures elsewhere: x and z in metres, facing in degrees. */
  put(places: Rows): void {
    this.rows("places", places, ["x", "z", "facing"]).forEach(([x, z, degrees], at) => {
      const figure = this.state.figures[at]!;
      const { playback, command } = figure;
      const facing = wrapped(degrees! * RADIANS);
      playback.root = [x!, z!, facing];
      playback.spring = [playback.spring[0], playback.spring[1], facing];
      const direction = command.speed > 0 ? command.direction : facing; // standing ones move the way they face
      figure.command = { ...command, direction, facing, facesWay: false };
      figure.target = this.model.abilities.target(figure.command).target;
      figure.going = null;
      figure.lock = newLock();
      figure.terrain = newTerrain();
      figure.acting = noAct(this.model.steerer, playback);
    });
    this.state.shown?.[1].forEach((pose, at) => this.state.late[at]!.push(...pose.events));
    this.state.shown = null; // nothing lies between there and here
  }

  /**
   * Add figures that stand at places, x and z in metres and facing in degrees, of one or of each; their numbers, which follow
   * those that there are. Each moves as in a session of its own that starts now. gait, phases: as those of `start`. ControlError
   * for what is out of range; nothing has changed then.
   */
  add(places: Rows, { gait, phases }: Pick<StartSettings, "gait" | "phases"> = {}): number[] {
    if (!Array.isArray(places) || !places.length)
      throw new ControlError("places needs x, z, facing, for each of the characters that are added");
    const { state, characters, model, holdFeet } = this;
    const count = Array.isArray(places[0]) ? places.length : 1;
    if (characters + count > CONTROL.LARGEST_CROWD)
      throw new ControlError(
        `a session has up to ${CONTROL.LARGEST_CROWD} characters, not ${characters + count}`,
      );
    const turns = phases ?? model.phases(characters + count)?.slice(characters);
    const more = model.start({
      characters: count,
      places,
      holdFeet,
      ...(gait !== undefined && { gait }),
      ...(turns !== undefined && { phases: turns }),
    });
    more.ground = this.ground;
    if (state.shown) more.advance(0);
    state.shown?.forEach((shown, at) => shown.push(...more.state.shown![at]!));
    state.figures.push(...more.state.figures);
    state.late.push(...more.state.late);
    return more.state.figures.map((_, at) => characters + at);
  }

  /** Remove figures by their numbers. Those behind move up. ControlError for figures that are not there, and for all: one stays. */
  remove(numbers: readonly number[]): void {
    if (!Array.isArray(numbers) || !numbers.length)
      throw new ControlError("ids needs the numbers of the figures that go");
    const gone = new Set(this.chosen(numbers));
    if (gone.size === this.characters) throw new ControlError("a session keeps one figure at least");
    const stay = <One>(all: One[]) => all.filter((_, at) => !gone.has(at));
    const { figures, late, shown } = this.state;
    Object.assign(this.state, {
      figures: stay(figures),
      late: stay(late),
      shown: shown && [stay(shown[0]), stay(shown[1])],
    });
  }

  /** The whole state, to be restored later. */
  snapshot(): ControlSnapshot {
    return { holdFeet: this.holdFeet, state: structuredClone(this.state) };
  }

  /** Go back to a snapshot of this session or of one like it, with as many figures as there were; ControlError for another. */
  restore(snapshot: ControlSnapshot): void {
    const state = snapshot.state as State;
    if (snapshot.holdFeet !== this.holdFeet)
      throw new ControlError(
        "a snapshot with held feet fits no session without them, nor the other way round",
      );
    this.state = structuredClone(state);
  }

  /** The numbers of figures. */
  private chosen(numbers?: readonly number[]): number[] {
    const figures = numbers ? [...numbers] : this.state.figures.map((_, at) => at);
    const fits =
      figures.length === new Set(figures).size &&
      figures.every((at) => Number.isInteger(at) && at >= 0 && at < this.characters);
    if (!fits)
      throw new ControlError(
        `figures are whole numbers from 0 to ${this.characters - 1}, none twice, not ${figures.join(", ")}`,
      );
    return figures;
  }

  private gaits(gaits: ForAll<string>): number[] {
    return this.forEach("gaits", gaits).map((name) => this.model.abilities.number(name));
  }

  /** A name for each figure, of one for all or one for each. */
  private forEach(what: string, names: ForAll<string>): string[] {
    const each = Array.isArray(names)
      ? (names as string[])
      : Array<string>(this.characters).fill(names as string);
    if (each.length !== this.characters)
      throw new ControlError(`${each.length} ${what} do not fit ${this.characters} characters`);
    return each;
  }

  /** A number for each figure; none if none is given. */
  private each(name: string, numbers?: ForAll<number>, count = this.characters): number[] | undefined {
    if (numbers === undefined) return undefined;
    const values = [numbers].flat().map((value) => [value]);
    return this.rows(name, values, [name], count).map(([value]) => value!);
  }

  /** A row of numbers for each figure, of one for all or one for each. */
  private rows(
    what: string,
    values: Rows,
    columns: string[],
    count = this.characters,
  ): readonly (readonly number[])[] {
    const rows = (Array.isArray(values?.[0]) ? values : [values]) as readonly (readonly number[])[];
    const fits =
      rows.every((row) => row?.length === columns.length) && (rows.length === 1 || rows.length === count);
    if (!fits)
      throw new ControlError(
        `${what} needs ${columns.join(", ")}, for all or for each of ${count} characters`,
      );
    if (
      !rows.every((row) =>
        Array.from(row).every(
          (value) => typeof value === "number" && Math.abs(value) <= TARGETS.LARGEST_COMMAND,
        ),
      )
    ) {
      throw new ControlError(`${what} must be finite numbers, no larger than ${TARGETS.LARGEST_COMMAND}`);
    }
    return rows.length === count ? rows : Array<readonly number[]>(count).fill(rows[0]!);
  }
}

/** A command with a velocity; one that stops leaves the direction, and how the figure faces. */
function byVelocity(command: Command, changes: Partial<Command>, [x, z]: readonly number[]): Command {
  const speed = Math.hypot(x!, z!);
  const moving = changed(command, {
    ...changes,
    speed,
    direction: speed > 0 ? Math.atan2(x!, z!) : command.direction,
  });
  return changes.facing === undefined ? { ...moving, facesWay: command.facesWay || speed > 0 } : moving;
}

function poseOf({ pose: { ground, rotations: local, height, contacts }, events }: Ticked): SteeredPose {
  const rotations: Record<string, Quaternion> = {};
  for (let bone = 0; bone < BONES.length; bone++) rotations[BONES[bone]!] = turnAt(local, bone);
  rotations.hips = product(about(Y, ground[2]), rotations.hips!);
  const [x, z, facing] = ground;
  const [left, right] = contacts;
  return { hips: [x, height, z], rotations, ground: [x, z, facing], contacts: [left, right], events };
}
