/* The page of `motet live`: figures, who steers them, time, and what is drawn. Metres, seconds and radians. */
import { fastest, type Net, ownControl, placeBehind, usual } from "./crowd.js";
import { addControls } from "./controls.js";
import type { Dropped } from "./drop.js";
import { type Asked, Figure, type Given as GivenNet, inRange, modelOf } from "./figure.js";
import { Hands } from "./hands.js";
import { eight, goTo, type Pilot } from "./pilots.js";
import { Recorder } from "./record.js";
import { Saying } from "./saying.js";
import { Scene } from "./scene.js";
import type { Stage } from "./stage.js";
import { stick } from "./stick.js";
import { type Act, actOf, numbersOf } from "../steering/acts.js";
import type { Going } from "../steering/paths.js";
import { type GivenActs, Repertoire } from "../steering/repertoire.js";
import type { Pose as Ground } from "../motion/planar.js";
import { RADIANS } from "../motion/rotations.js";
import { captionOf, Words } from "../steering/spoken.js";

/** What motet/live/page.py writes into a page. bytes: base64. */
export interface Given {
  net: GivenNet;
  acts: GivenActs;
  body: { height: number };
  characters: number;
  most: number;
}

/** Seconds that a frame counts for, at most, and for which a page is drawn after something was done. */
const LATEST = 0.1;
const AWAKE = 1;
/** What may change the picture though time stands still. */
const DONE = ["click", "change", "input", "keydown", "drop"];

export class Page {
  readonly figures: Figure[] = [];
  /** What can be typed, and the acts that are done then; they come once the first picture is drawn. */
  words!: Words;
  repertoire!: Repertoire;
  /** What was typed, as long as something of it is to come. */
  saying: Saying | null = null;
  readonly state = {
    gait: 0,
    hurry: false,
    strafe: false,
    trails: true,
    contacts: false,
    follows: true,
    pause: false,
    pace: 1,
  };
  /** Who steers while no hand does. */
  pilot: Pilot | null = null;
  /** Whether the first figure was told an act of the whole body, and whether what steered it then is held still. */
  private whole = false;
  private held = false;
  /** Since the page was opened. */
  ticks = 0;
  private ahead = 0;
  /** Seconds for which it draws on though time stands still: until the camera has come. */
  private awake = 0;
  private last: number | null = null;

  constructor(
    readonly net: Net,
    readonly stage: Stage,
    readonly scene: Scene,
    readonly hands: Hands,
    readonly recorder: Recorder,
    private readonly say: (text: string) => void,
  ) {}

  get view() {
    return this.stage.view;
  }

  /** So many figures in all; those that come stand behind the first one. */
  setFigures(count: number): void {
    const { figures, net } = this;
    figures.length = Math.min(figures.length, count);
    for (let n = figures.length; n < count; n++) {
      const phase = n ? n % net.model.steerer.matcher.settings.search_every : undefined;
      const place: Ground = n ? placeBehind(figures[0]!.root, n) : [0, 0, 0];
      figures.push(new Figure(net.model, place, phase));
    }
  }

  /** A figure of eight until somebody steers. */
  startByItself(): void {
    this.pilot = eight(this.figures[0]!);
  }

  /** Do what a sentence says; what is to be answered. Nothing is done of one that is not known. */
  obey(text: string): string {
    const reading = this.words.read(text);
    if (reading.steps.length) {
      this.saying = new Saying(reading);
      this.saying.tick(this);
    }
    return captionOf(reading);
  }

  /** Go to a point on the ground, whatever was typed before. */
  goTo(point: readonly [number, number]): void {
    this.saying = null;
    this.pilot = goTo(point);
  }

  /** Take what was dropped; what is to be said of it. */
  show({ text, avatar, motion }: Dropped): string {
    this.view.dirty = true;
    if (avatar) this.scene.become(avatar);
    if (motion) this.act(actOf(this.net.model, text, numbersOf(this.net.model, motion)), false, false);
    return text;
  }

  /** Do once what a gait that goes nowhere shows, of all figures or the first, and go on. */
  once(gait: string, all = false): void {
    for (const figure of all ? this.figures : [this.figures[0]!])
      figure.act(this.net.model.take(gait, figure.goes), false);
  }

  /** Begin an act, of all figures or the first; one of the whole body ends what steers it. */
  act(act: Act, arms: boolean, all: boolean): void {
    if (!arms) this.pilot = null;
    this.whole = this.held = !arms;
    for (const figure of all ? this.figures : [this.figures[0]!]) {
      figure.act(act, figure.goes && !arms ? false : undefined);
    }
  }

  /** The number of the style in which figures go from now on. */
  style(number: number, all: boolean): void {
    for (const figure of all ? this.figures : [this.figures[0]!]) figure.style = number;
  }

  /** End what figures do. */
  rest(all: boolean): void {
    for (const figure of all ? this.figures : [this.figures[0]!]) figure.act(null);
  }

  /** What the first figure is asked: by hand, or else by its pilot, or else to stand. */
  command(): Asked | Going {
    const [x, y] = this.hands.pushed;
    const pushed = x !== 0 || y !== 0;
    if (pushed) this.saying = null;
    this.saying?.tick(this);
    this.held &&= pushed;
    if (this.whole && !this.held && (pushed || this.pilot)) {
      this.figures[0]!.act(null);
      this.whole = false;
    }
    if (pushed) this.pilot = null;
    else if (this.pilot) {
      const command = this.pilot.ask(this.net, this.figures[0]!);
      if (command) return command;
      this.pilot = null;
    }
    return this.byHand(x, y);
  }

  private byHand(x: number, y: number): Asked {
    const { net, state } = this;
    const strength = Math.hypot(x, y);
    const away = this.view.yaw * RADIANS + Math.PI;
    const { gait, pace } = this.paced(strength);
    const way = away - Math.atan2(x, y);
    const { acting, wanted, root } = this.figures[0]!;
    const kept = acting ? root[2] : wanted.facing; // while the whole body acts, its facing is the act's
    const facing = state.strafe ? away : strength ? way : kept;
    const speed = strength ? inRange(net.model, gait, pace, way - facing) : 0;
    return { gait, x: speed * Math.sin(way), z: speed * Math.cos(way), facing };
  }

  /** The gait and speed of keys or a stick pushed so far: a stick alone goes from a creep to a run. */
  private paced(strength: number): { gait: number; pace: number } {
    const { net, state, hands } = this;
    const fast = fastest(net);
    if (state.gait === 0 && hands.byStick && !state.hurry && !hands.hurries) {
      const paces = { least: net.speeds[net.gaits[0]!]![0]!, walk: usual(net, 0), run: usual(net, fast) };
      const { speed, runs } = stick(strength, this.figures[0]!.wanted.gait === fast, paces);
      return { gait: runs ? fast : 0, pace: speed };
    }
    const gait = (state.hurry || hands.hurries) && state.gait === 0 ? fast : state.gait;
    return { gait, pace: strength * usual(net, gait) };
  }

  /** A tick of all figures, the first of them with a control. */
  tick(control: Asked | Going): void {
    const { figures, net, state } = this;
    figures.forEach((figure, n) => figure.tick(n ? ownControl(net, figures, n, state.follows) : control));
    this.ticks++;
    this.scene.keep(figures);
    this.recorder.keep(figures[0]!.pose);
  }

  /** A picture at a moment in milliseconds, and the ticks before it. */
  frame(now: number): void {
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, LATEST);
    this.last = now;
    this.hands.look(passed);
    this.awake = this.view.dirty || !this.state.pause ? AWAKE : this.awake - passed;
    this.view.dirty = false;
    if (this.awake < 0) return;
    if (!this.state.pause) this.ahead += passed * this.net.fps * this.state.pace;
    for (; this.ahead >= 1; this.ahead--) this.tick(this.command());
    const poses = this.figures.map((figure) => figure.shown(this.ahead));
    this.scene.draw(poses, passed, this.figures, this.pilot?.goal, this.state);
    this.tell();
  }

  private tell(): void {
    const { velocity, wanted } = this.figures[0]!;
    this.say(`${this.net.gaits[wanted.gait]} · ${Math.hypot(...velocity).toFixed(1)} m/s`);
  }
}

/** Open the page of what motet/live/page.py has written. */
export async function open(embedded: Given, stage: Stage): Promise<Page> {
  const element = (id: string) => document.getElementById(id)!;
  const canvas = element("canvas") as HTMLCanvasElement;
  const scene = new Scene(stage, canvas, embedded.body, embedded.body.height); // its programs are compiled while tables are unpacked
  const model = await modelOf(embedded.net);
  const speeds = Object.fromEntries(model.gaits.map((gait, n) => [gait, model.abilities.speeds[n]!]));
  const net: Net = { model, gaits: model.gaits, fps: model.fps, speeds, rows: model.steerer.matcher.rows };
  const page = new Page(
    net,
    stage,
    scene,
    new Hands(stage, element("stick")),
    new Recorder(net.fps, scene, canvas),
    announcer(element("speed")),
  );
  page.setFigures(embedded.characters);
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) page.startByItself();
  for (const done of DONE) addEventListener(done, () => (stage.view.dirty = true));
  await drawn(page);
  page.repertoire = await Repertoire.of(embedded.acts, model);
  const goOn = model.gaits.filter((gait) => speeds[gait]![1]! > 0);
  page.words = new Words(embedded.acts.words, page.repertoire.entries, goOn);
  addControls(page, embedded.most);
  return page;
}

/** Draw frame after frame; done once the first one is drawn. */
function drawn(page: Page): Promise<void> {
  return new Promise((done) => {
    const frame = (now: number) => {
      page.frame(now);
      requestAnimationFrame(frame);
      done();
    };
    requestAnimationFrame(frame);
  });
}

/** Writes what changes into an element. */
function announcer(element: HTMLElement): (text: string) => void {
  let last = "";
  return (text) => {
    if (text !== last) element.textContent = last = text;
  };
}
