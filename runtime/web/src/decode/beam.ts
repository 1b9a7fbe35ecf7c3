import { integers } from "../bundle/arrays.js";
import { type Arrays, type Graph, taken } from "../bundle/graph.js";

/** A finished sequence of ids, without its end, and the sum of its log-probabilities, with it. score: its rank. */
export interface Hypothesis {
  ids: number[];
  logProbability: number;
  score: number;
}

interface Open {
  ids: number[];
  score: number;
  ended: boolean;
}

/** Ids of start and end, ids that are never chosen, and the longest sequence. */
export interface Limits {
  start: number;
  end: number;
  banned: number[];
  longest: number;
}

/**
 * The most probable sequences for contexts, best first: docs/reference/bundle.md, the loop `beam`. The contexts are what
 * the step takes of a motion (1, ...), by name.
 */
export async function beamSearch(
  step: Graph,
  contexts: Arrays,
  limits: Limits,
  beams: number,
): Promise<Hypothesis[]> {
  const { start, end, banned, longest } = limits;
  let kept: Open[] = [{ ids: [], score: 0, ended: false }];
  let states = step.zeroState(1);
  for (let length = 0; length <= longest && kept.some((hypothesis) => !hypothesis.ended); length++) {
    const open = kept.filter((hypothesis) => !hypothesis.ended);
    const word = integers(open.map((hypothesis) => hypothesis.ids.at(-1) ?? start));
    const repeated = taken(
      contexts,
      open.map(() => 0),
    );
    const { outputs, states: next } = await step.step({ word, ...repeated }, states);
    const { data, shape } = outputs.log_probabilities!;
    const words = shape[1]!;
    const grown: (Open & { parent: number })[] = [];
    for (const hypothesis of kept) {
      if (hypothesis.ended) {
        grown.push({ ...hypothesis, parent: -1 });
        continue;
      }
      const parent = open.indexOf(hypothesis);
      const gains = data.subarray(parent * words, (parent + 1) * words);
      const chosen = length === longest ? [end] : best(gains, beams, banned);
      for (const id of chosen) {
        const ids = id === end ? hypothesis.ids : [...hypothesis.ids, id];
        grown.push({ ids, score: hypothesis.score + gains[id]!, ended: id === end, parent });
      }
    }
    const order = grown.map((_, at) => at).sort((a, b) => grown[b]!.score - grown[a]!.score || a - b);
    const winners = order.slice(0, beams).map((at) => grown[at]!);
    const parents = winners.filter((winner) => !winner.ended).map((winner) => winner.parent);
    states = taken(next, parents);
    kept = winners;
  }
  return kept.map(({ ids, score }) => ({ ids, logProbability: score, score }));
}

/** The log-probability of a sequence of ids, and of its end, for contexts as {@link beamSearch} takes them. */
export async function scoreWords(
  step: Graph,
  contexts: Arrays,
  { start, end }: Limits,
  ids: number[],
): Promise<number> {
  let states = step.zeroState(1);
  let sum = 0;
  for (const [at, id] of [...ids, end].entries()) {
    const next = await step.step({ word: integers([ids[at - 1] ?? start]), ...contexts }, states);
    sum += next.outputs.log_probabilities!.data[id]!;
    states = next.states;
  }
  return sum;
}

/** The ids of the highest values, highest first. */
function best(values: Float32Array, count: number, banned: number[]): number[] {
  const ids = Array.from(values.keys()).filter((id) => !banned.includes(id));
  return ids.sort((a, b) => values[b]! - values[a]! || a - b).slice(0, count);
}
