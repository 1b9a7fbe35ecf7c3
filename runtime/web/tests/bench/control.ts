/* Milliseconds of processor time of a tick of steered figures: `npm run bench:control`. They walk, run and stand; of several passes the best mean counts. */
import { type ControlModel, load } from "../../src/index.js";
import { bundle } from "../bundles.js";

const PASSES = 7;
const ORDERS = [
  ["walk", 1.3, 0],
  ["run", 3, 90],
  ["walk", 0, 90],
] as const;

const model = (await load(await bundle("control"))) as ControlModel;

/** The mean over a pass, and its slowest tick. */
function pass(characters: number, holdFeet: boolean, ticks: number): { mean: number; worst: number } {
  const session = model.start({ characters, holdFeet });
  const times: number[] = [];
  for (const [gait, speed, direction] of ORDERS) {
    session.control({
      gait,
      speed,
      direction: Array.from({ length: characters }, (_, at) => direction + at),
    });
    for (let at = 0; at < ticks; at++) {
      const start = process.cpuUsage();
      session.tick();
      const { user, system } = process.cpuUsage(start);
      times.push((user + system) / 1000);
    }
  }
  return { mean: times.reduce((sum, time) => sum + time) / times.length, worst: Math.max(...times) };
}

for (const [characters, ticks] of [
  [1, 900],
  [1000, 30],
] as const) {
  for (const holdFeet of [false, true]) {
    const found = Array.from({ length: PASSES }, () => pass(characters, holdFeet, ticks));
    const { mean, worst } = found.reduce((best, one) => (one.mean < best.mean ? one : best));
    const feet = holdFeet ? "feet held" : "without the lock";
    console.log(
      `${characters} figures, ${feet}: ${mean.toFixed(3)} ms a tick, the slowest ${worst.toFixed(2)} ms`,
    );
  }
}
