/* What was typed, step by step: motet/steering/saying.py, on the page. */
import { fastest, usual } from "./crowd.js";
import type { Page } from "./page.js";
import { goTo, Order } from "./pilots.js";
import { RADIANS } from "../motion/rotations.js";
import { SAYING, STYLES } from "../generated.js";
import { paceOfStyle, styleNumber } from "../steering/styleLayer.js";
import type { Reading, Step } from "../steering/spoken.js";

export class Saying {
  private readonly all: boolean;
  private readonly steps: Step[];
  private at = -1;
  private ticks = 0;

  constructor({ steps, everyone }: Reading) {
    this.all = everyone;
    // what lasts for some seconds ends in standing
    const last = steps.at(-1)!;
    this.steps = last.seconds ? [...steps, { ...last, kind: "stop", seconds: 0 }] : steps;
  }

  /** Begin the next steps where those before are over; the page forgets it after the last. */
  tick(page: Page): void {
    this.ticks++;
    while (this.at + 1 < this.steps.length && this.isOver(page)) {
      this.at++;
      this.ticks = 0;
      this.begin(this.steps[this.at]!, page);
    }
    if (this.at + 1 === this.steps.length) page.saying = null;
  }

  private isOver(page: Page): boolean {
    const step = this.steps[this.at];
    const next = this.steps[this.at + 1]!;
    if (!step) return true;
    const isDone = next.kind !== "act" || page.repertoire.entries.get(next.name)!.arms;
    if (next.together && isDone) return true;
    if (step.kind === "act") return this.ticks > 1 && !page.figures[0]!.acting;
    if (step.kind === "here") return !page.pilot;
    return this.ticks >= Math.round(secondsOf(step) * page.net.fps);
  }

  private begin(step: Step, page: Page): void {
    const figure = page.figures[0]!;
    const { net } = page;
    const [x, z, facing] = figure.root;
    const towardsCamera = page.view.yaw * RADIANS;
    if (step.kind === "act") this.act(step, page);
    else if (step.kind === "stop") {
      page.rest(this.all);
      page.pilot = new Order(0, 0, facing);
    } else if (step.kind === "here") {
      const away = SAYING.NEARER_DISTANCE;
      page.pilot = goTo([x + away * Math.sin(towardsCamera), z + away * Math.cos(towardsCamera)]);
    } else if (step.kind === "away") {
      page.pilot = new Order(0, usual(net, 0), towardsCamera + Math.PI);
    } else {
      const before = { gait: figure.wanted.gait, speed: Math.hypot(figure.wanted.x, figure.wanted.z) };
      const { gait, speed } = paceOf(step, before, page);
      if (step.name) page.style(styleOf(step), this.all);
      const turn = step.aside ? 0 : step.way;
      const aside = step.aside ? step.way : 0;
      // from where it is to face, even if it has not come to it yet
      const { facing } = figure.wanted;
      page.pilot = new Order(gait, speed, facing + RADIANS * turn, RADIANS * aside, RADIANS * step.curve);
    }
  }

  private act({ name, side, tempo, count }: Step, page: Page): void {
    const isPlain = !side && tempo === 1 && count === 1;
    if (isPlain && page.net.gaits.includes(name)) page.once(name, this.all);
    else {
      const { arms } = page.repertoire.entries.get(name)!;
      page.act(page.repertoire.act(name, side, tempo, count), arms, this.all);
    }
  }
}

/** How long a step lasts before the next one. */
function secondsOf(step: Step): number {
  if (step.seconds) return step.seconds;
  if (step.kind === "go" && step.name) return SAYING.GOING_SECONDS;
  return SAYING.TURN_SECONDS + SAYING.SECONDS_OF_DEGREE * Math.abs(step.way);
}

/** The number of the style of a step. */
function styleOf({ style }: Step): number {
  return styleNumber(style || STYLES.NO_STYLE);
}

/** The gait and the speed of a step, from those before it. */
function paceOf(
  step: Step,
  before: { gait: number; speed: number },
  { net }: Page,
): { gait: number; speed: number } {
  const { name, pace, change } = step;
  if (name) {
    const gait = net.gaits.indexOf(name);
    return { gait, speed: pace * paceOfStyle(styleOf(step)) * usual(net, gait) };
  }
  const { gait } = before;
  if (change === 1) return before;
  if (!before.speed) return { gait, speed: usual(net, gait) * change };
  const speed = before.speed * change;
  const [, , most] = net.speeds[net.gaits[gait]!] as [number, number, number];
  const runs = gait === 0 && speed > most;
  const walks = gait === fastest(net) && speed < net.speeds[net.gaits[gait]!]![0]!;
  if (runs) return { gait: fastest(net), speed };
  return { gait: walks ? 0 : gait, speed };
}
