/* What is seen: figures as they are between two ticks, the ways they have gone and are asked to go, feet that stand. */
import { SIDES } from "../figures/humanoid/bones.js";
import { times, type Vector } from "../motion/rotations.js";
import { FEET, type Figure, type Shown } from "./figure.js";
import type { Avatar } from "./avatar.js";
import { drawnLandscape, metBy } from "./landscape.js";
import type { Body, Camera, Drawn, Painter, Spot, Stage, Strip } from "./stage.js";

/** What a figure looks like: what is drawn of it in a pose. */
type Looks = (shown: Shown, n: number) => Drawn;

/** Points of a way gone that are kept, ticks from one to the next, and how many figures' ways are shown. */
const TRAIL = 60;
const SPARSE = 5;
const TRACED = 12;
/** Seconds of the asked path, and between its points. */
const SOON = 1.4;
const APART = 0.1;
/** Seconds in which the camera comes half of the way after a figure, along the ground and up, and how far it steps back for each further row. */
const LATE = [0.12, 0.5, 0.12] as const;
const STEP_BACK = 0.28;

export interface Shows {
  trails: boolean;
  contacts: boolean;
  pause: boolean;
}

export class Scene {
  readonly painter: Painter;
  /** The usual one. */
  readonly body: Body;
  private readonly landscape: Drawn;
  private camera: Camera | null = null;
  private target: Vector | null = null;
  private readonly trails = new WeakMap<Figure, [x: number, z: number][]>();
  private looks: Looks;
  private avatar: unknown = null;
  private ticks = 0;

  /** height: of the usual body, in metres, by which all is drawn. */
  constructor(
    private readonly stage: Stage,
    private readonly canvas: HTMLCanvasElement,
    body: unknown,
    readonly height: number,
  ) {
    const painter = stage.openStage(canvas);
    if (!painter) throw new Error("it has no WebGL2");
    this.painter = painter;
    const first = (this.body = painter.body(body));
    this.landscape = drawnLandscape(painter, height);
    this.looks = ({ turned, places }, n) => ({ body: first, turned, places, unit: 1 / height, colour: n });
  }

  /** From now on the first figure is an avatar. */
  become(avatar: Avatar): void {
    if (this.avatar) this.painter.drop(this.avatar);
    const body = (this.avatar = this.painter.avatar(avatar.mesh));
    const others = this.looks;
    this.looks = (shown, n) =>
      n ? others(shown, n) : { body, ...avatar.posed(shown), unit: avatar.scale / this.height };
  }

  /** Remember where figures are, once a tick. */
  keep(figures: Figure[]): void {
    if (this.ticks++ % SPARSE) return;
    for (const figure of figures) {
      const trail = this.trails.get(figure) ?? [];
      trail.push(this.placeOf(figure));
      if (trail.length > TRAIL) trail.shift();
      this.trails.set(figure, trail);
    }
  }

  /** Draw figures in poses, so many seconds after the last picture; their ways where these are given. */
  draw(
    poses: Shown[],
    passed: number,
    figures: Figure[],
    goal: readonly [number, number] | undefined,
    shows: Shows,
  ): void {
    const { width, height } = this.painter.begin(shows.pause);
    if (!width || !height) return;
    this.camera = this.follow(poses, passed, width, height);
    const strips = shows.trails ? figures.slice(0, TRACED).map((figure, n) => this.gone(figure, n)) : [];
    if (shows.trails && figures[0]) strips.push(this.planned(figures[0]));
    const spots = shows.contacts ? poses.flatMap((pose) => this.standing(pose)) : [];
    if (goal) spots.push(this.spot(goal, 0.09, this.accent, 0.6));
    const drawn = [this.landscape, ...poses.map((pose, n) => this.looks(pose, n))];
    this.painter.draw(this.camera, { figures: drawn, strips, spots });
  }

  /** Let the camera be at once where it would come to. */
  cut(): void {
    this.target = null;
  }

  /** x and z in metres where a pixel of the canvas shows the ground. */
  groundAt(x: number, y: number): [x: number, z: number] | null {
    if (!this.camera) return null;
    const { eye, ray } = this.stage.rayAt(this.camera, x, y);
    return metBy(times(eye, this.height), ray);
  }

  /** The camera comes after the first figure without its sway, at half of the height it takes, further away where there are many. */
  private follow(poses: Shown[], passed: number, width: number, height: number): Camera {
    const { ground, places } = poses[0]!;
    const heights = places.map(([, y]) => y);
    const middle = (Math.min(...heights) + Math.max(...heights)) / 2;
    const goal = [ground[0], middle, ground[1]].map((x) => x / this.height) as Vector;
    const before = this.target ?? goal;
    this.target = before.map((x, i) => goal[i]! + (x - goal[i]!) * 0.5 ** (passed / LATE[i]!)) as Vector;
    const away = STEP_BACK * Math.sqrt(4 * (poses.length - 1));
    return this.stage.cameraAt([...this.target], 0, away, width, height, this.covered(height));
  }

  /** Pixels at the lower end of the canvas that the text box takes, if it is there. */
  private covered(height: number): number {
    const top = this.canvas.parentElement!.querySelector("form")?.offsetTop ?? 0;
    return top > height / 2 ? height - top : 0;
  }

  private gone(figure: Figure, n: number): Strip {
    const points = [this.placeOf(figure), ...[...(this.trails.get(figure) ?? [])].reverse()]; // from the figure on, so that its end fades
    return { points, colour: this.accent, alpha: n ? 0.15 : 0.4, fade: true };
  }

  private placeOf({ root: [x, z] }: Figure): [x: number, z: number] {
    return [x / this.height, z / this.height];
  }

  private planned(figure: Figure): Strip {
    const points = Array.from({ length: SOON / APART + 1 }, (_, at): [number, number] => {
      const [x, z] = figure.later(at * APART);
      return [x / this.height, z / this.height];
    });
    return { points, colour: this.stage.COLOURS.left, alpha: 0.7, width: 0.035, arrows: true };
  }

  private standing({ contacts, places }: Shown): Spot[] {
    return SIDES.flatMap((side, at) => {
      const [ankle, toes] = FEET[at]!.map((joint) => places[joint]!) as [Vector, Vector];
      const middle = [0, 2].map((i) => ankle[i]! + 0.6 * (toes[i]! - ankle[i]!)) as [number, number];
      return contacts[at]! < 0.5 ? [] : [this.spot(middle, 0.1, this.stage.COLOURS[side], 0.45)];
    });
  }

  private spot(
    [x, z]: readonly [number, number],
    radius: number,
    colour: readonly number[],
    alpha: number,
  ): Spot {
    return { x: x / this.height, z: z / this.height, radius, colour, alpha };
  }

  private get accent(): readonly number[] {
    return this.stage.COLOURS.right;
  }
}
