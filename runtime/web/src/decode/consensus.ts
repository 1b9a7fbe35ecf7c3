/* The sentence that agrees best with many drawn ones: docs/reference/bundle.md, the loop `consensus`. */
import { type Hypothesis, type Limits, nextWords } from "./beam.js";
import { type Arrays, type Graph, taken } from "../bundle/graph.js";
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
  let open: Beginning[] = [
    { ids: [], score: 0, draws: Array.from({ length: draws }, (_, at) => at), ended: false },
  ];
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
    states = taken(
      next,
      going.map((beginning) => beginning.row),
    );
    open = going;
  }
  ended.sort((a, b) => a.draws[0]! - b.draws[0]!);
  return ended.map(({ ids, score, draws: members }) => ({
    ids,
    logProbability: score,
    times: members.length,
  }));
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
  const most = left.reduce((a, b) => Math.max(a, b));
  let sum = 0;
  const shares = left.map((value) => (sum += Math.exp((value - most) / temperature)));
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
  const orders = [1, 2].map((order) => drawn.map(({ ids }) => counted(ids, order)));
  return drawn.map((_, at) => {
    const shared = orders.map((grams) =>
      drawn.reduce((sum, { times }, other) => sum + times * f1(grams[at]!, grams[other]!), 0),
    );
    return (shared[0]! + shared[1]!) / (2 * all);
  });
}

/** How often each run of `order` words comes. */
function counted(ids: number[], order: number): Map<string, number> {
  const counts = new Map<string, number>();
  for (let at = 0; at + order <= ids.length; at++) {
    const gram = `${ids.slice(at, at + order)}`;
    counts.set(gram, (counts.get(gram) ?? 0) + 1);
  }
  return counts;
}

function f1(first: Map<string, number>, other: Map<string, number>): number {
  const size = (grams: Map<string, number>) => [...grams.values()].reduce((a, b) => a + b, 0);
  let both = 0;
  for (const [gram, times] of first) both += Math.min(times, other.get(gram) ?? 0);
  return (2 * both) / Math.max(size(first) + size(other), 1);
}
