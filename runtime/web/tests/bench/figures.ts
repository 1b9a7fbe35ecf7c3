/* How long it takes to load the bundle generate, to the first frames of a stream, and to seven seconds of motion. */
import { type GenerateModel, load } from "../../src/index.js";
import type { Read } from "../cases.js";

/** Milliseconds: of the first call, the median and the least of further ones. */
export type Times = Record<string, { first: number; median: number; least: number }>;

const TEXT = "a person walks forward";

export async function figures(read: Read): Promise<Times> {
  const zip = await read("generate");
  const model = (await load(zip)) as GenerateModel;
  return {
    load: await timed(() => load(zip), 3),
    "first frame": await timed(() => model.stream(TEXT).next(), 30),
    "seven seconds": await timed(() => model.generate(TEXT, { seconds: 7 }), 30),
  };
}

async function timed(call: () => Promise<unknown>, count: number) {
  const taken: number[] = [];
  for (let left = count + 1; left; left--) {
    const start = performance.now();
    await call();
    taken.push(performance.now() - start);
  }
  const [first, ...others] = taken;
  others.sort((a, b) => a - b);
  return { first: first!, median: others[others.length >> 1]!, least: others[0]! };
}
