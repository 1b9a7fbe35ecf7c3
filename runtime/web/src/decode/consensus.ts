/* The sentence that agrees best with many drawn ones: docs/reference/bundle.md, the loop `consensus`. */
import { type Hypothesis, type Limits, nextWords } from "./beam.js";
import { type Arrays, type Graph, taken } from "../bundle/graph.js";
import { counted, most, sumOf } from "../motion/numbers.js";
import type { Noise } from "./random.js";

/** A drawn sequence of ids, the model's log-probability of it, and how often it came. */
interface Drawn {
  ids: number[];
  logProbability: number;
  times: number;
}

/** Draws that begin alike, and share their states. */
interface Beginning {
  ids: number[];
  score: number;
  draws: number[];
  ended: boolean;
}

/** The sequences drawn for contexts as beamSearch takes them, the one that agrees best with all first; scores are agreements, 0 to 1. */
export async function consensus(
  step: Graph,
  contexts: Arrays,
  limits: Limits,
  draws: number,
  temperature: number,
  noise: Noise,
): Promise<Hypothesis[]> {
  const drawn = await drawSequences(step, contexts, limits, draws, temperature, noise);
  const scores = agreement(drawn);
  const equal = scores.map((score) => Math.round(score * 1e9)); // what only rounding tells apart
  const order = drawn
    .map((_, at) => at)
    .sort((a, b) => equal[b]! - equal[a]! || drawn[b]!.logProbability - drawn[a]!.logProbability);
  return order.map((at) => ({
    ids: drawn[at]!.ids,
    logProbability: drawn[at]!.logProbability,
    score: scores[at]!,
  }));
}

async function drawSequences(
  step: Graph,
  contexts: Arrays,
  limits: Limits,
  draws: number,
  temperature: number,
  noise: Noise,
): Promise<Drawn[]> {
  const uniform = Array.from({ length: limits.longest + 1 }, () => noise.uniform(draws));
  let open: Beginning[] = [{ ids: [], score: 0, draws: [...Array(draws).keys()], ended: false }];
  let states = step.zeroState(1);
  const ended: Beginning[] = [];
  for (let length = 0; open.length; length++) {
    const { gains, states: next } = await nextWords(step, contexts, open, limits.start, states);
    const grown = open.flatMap((beginning, row) =>
      spread(beginning, gains[row]!, limits, length, temperature, uniform[length]!).map((share) => ({
        ...share,
        row,
      })),
    );
    ended.push(...grown.filter((beginning) => beginning.ended));
    const going = grown.filter((beginning) => !beginning.ended);
    const parents = going.map((beginning) => beginning.row);
    states = taken(next, parents);
    open = going;
  }
  ended.sort((a, b) => a.draws[0]! - b.draws[0]!);
  return ended.map(({ ids, score, draws: { length } }) => ({ ids, logProbability: score, times: length }));
}

/** What the draws of a beginning go on with: each word as often as its share of them, rounded up or down. */
function spread(
  beginning: Beginning,
  gains: Float32Array,
  limits: Limits,
  length: number,
  temperature: number,
  uniform: number[],
): Beginning[] {
  const { banned, end, longest } = limits;
  const left = Float64Array.from(gains, (gain, id) =>
    banned.includes(id) || (length === longest && id !== end) ? -Infinity : gain,
  );
  const highest = most(left);
  let sum = 0;
  const shares = left.map((value) => (sum += Math.exp((value - highest) / temperature)));
  const beginnings: Beginning[] = [];
  let id = 0;
  let last = -1;
  beginning.draws.forEach((draw, rank) => {
    const place = (rank + uniform[beginning.draws[0]!]!) / beginning.draws.length;
    while (shares[id]! / sum <= place) id++;
    if (id === last) return void beginnings.at(-1)!.draws.push(draw);
    last = id;
    const ids = id === end ? beginning.ids : [...beginning.ids, id];
    beginnings.push({ ids, score: beginning.score + gains[id]!, draws: [draw], ended: id === end });
  });
  return beginnings;
}

/** What each sequence has in common with all, each as often as it came: the mean F1 of words and of their pairs. */
function agreement(drawn: Drawn[]): number[] {
  const all = drawn.reduce((sum, { times }) => sum + times, 0);
  const orders = [1, 2].map((order) => drawn.map(({ ids }) => counted(grams(ids, order))));
  return drawn.map((_, at) => {
    const shared = orders.map((counts) =>
      drawn.reduce((sum, { times }, other) => sum + times * f1(counts[at]!, counts[other]!), 0),
    );
    return (shared[0]! + shared[1]!) / (2 * all);
  });
}

/** Each run of `order` words. */
function grams(ids: number[], order: number): string[] {
  const starts = ids.slice(order - 1);
  return starts.map((_, at) => `${ids.slice(at, at + order)}`);
}

function f1(first: Map<string, number>, other: Map<string, number>): number {
  const size = (counts: Map<string, number>) => sumOf([...counts.values()]);
  let both = 0;
  for (const [gram, times] of first) both += Math.min(times, other.get(gram) ?? 0);
  return (2 * both) / Math.max(size(first) + size(other), 1);
}
