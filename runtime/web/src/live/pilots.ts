/* Who steers the first figure while no hand does: a figure of eight, a point to go to, or an order. */
import { type Going, sent } from "../steering/paths.js";
import { type Asked, type Figure, inRange } from "./figure.js";
import { moved } from "../motion/planar.js";
import { fastest, type Net, towards, usual } from "./crowd.js";

/** Asks a figure each tick, or leads it along a path; null when it is done. goal: where it goes, x and z in metres. */
export interface Pilot {
  readonly goal?: readonly [number, number];
  ask(net: Net, figure: Figure): Asked | Going | null;
}

/** Half the length of an eight, how far ahead its point is, and a step along it; metres, metres, radians. */
const HALF = 3.2;
const AHEAD = 0.9;
const STEP = 0.02;
/** m/s at which the second round is run. */
const RUNS = 2.6;
/** Metres from its point from which on a figure runs there, and within which it is there. */
const FAR_AWAY = 5;
const THERE = 0.01;

/** A figure of eight about where a figure stands, Gerono's lemniscate: walked, then run, in turns. */
export function eight({ root: [x, z, facing] }: Figure): Pilot {
  let along = 0;
  const turned = facing - Math.PI / 4; // it starts at an angle of 45 degrees to its length
  const point = (): [number, number] => {
    const ahead = HALF * Math.sin(along);
    const [toX, toZ] = moved([x, z, turned], [ahead, ahead * Math.cos(along), 0]);
    return [toX, toZ];
  };
  const away = ({ root }: Figure) => Math.hypot(point()[0] - root[0], point()[1] - root[1]);
  return {
    ask(net, figure) {
      while (away(figure) < AHEAD) along += STEP;
      const runs = Math.floor(along / (2 * Math.PI)) % 2 === 1;
      return towards(net, [figure], 0, point(), runs ? RUNS : usual(net, 0));
    },
  };
}

/** Go to a point and stop there; run where it is far. */
export function goTo(goal: readonly [number, number]): Pilot {
  let going: Going | null = null;
  return {
    goal,
    ask(net, { restingPlace }) {
      const away = Math.hypot(goal[0] - restingPlace[0], goal[1] - restingPlace[1]);
      const gait = away > FAR_AWAY ? fastest(net) : 0;
      going ??= sent([restingPlace, goal], { gait, speed: usual(net, gait), facing: null });
      return going.arrived && away < THERE ? null : going;
    },
  };
}

/** An order that stays: a gait, its speed, the facing, and where it goes from there. Radians to the left. */
export class Order implements Pilot {
  /** aside: from the facing to the way that it goes. curve: radians a second. */
  constructor(
    readonly gait: number,
    readonly speed: number,
    private facing: number,
    private readonly aside = 0,
    private readonly curve = 0,
  ) {}

  ask({ model, fps }: Net): Asked {
    this.facing += this.curve / fps;
    const speed = this.speed ? inRange(model, this.gait, this.speed, this.aside) : 0;
    const way = this.facing + this.aside;
    return { gait: this.gait, x: speed * Math.sin(way), z: speed * Math.cos(way), facing: this.facing };
  }
}
