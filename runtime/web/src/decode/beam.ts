import { integers, rows } from "../bundle/arrays.js";
import { type Arrays, type Graph, taken } from "../bundle/graph.js";
import { ranked } from "../motion/numbers.js";

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
    const following = await nextWords(step, contexts, open, start, states);
    const grown: (Open & { parent: number })[] = [];
    for (const hypothesis of kept) {
      if (hypothesis.ended) {
        grown.push({ ...hypothesis, parent: -1 });
        continue;
      }
      const parent = open.indexOf(hypothesis);
      const gains = following.gains[parent]!;
      const chosen = length === longest ? [end] : best(gains, beams, banned);
      for (const id of chosen) {
        const ids = id === end ? hypothesis.ids : [...hypothesis.ids, id];
        grown.push({ ids, score: hypothesis.score + gains[id]!, ended: id === end, parent });
      }
    }
    const order = ranked(grown.map(({ score }) => score));
    const winners = order.slice(0, beams).map((at) => grown[at]!);
    const parents = winners.filter((winner) => !winner.ended).map((winner) => winner.parent);
    states = taken(following.states, parents);
    kept = winners;
  }
  return kept.map(({ ids, score }) => ({ ids, logProbability: score, score }));
}

/** Of open sequences the log-probabilities of all words that may follow, a row each, and the states then. */
export async function nextWords(
  step: Graph,
  contexts: Arrays,
  open: { ids: number[] }[],
  start: number,
  states: Arrays,
) {
  const word = integers(open.map(({ ids }) => ids.at(-1) ?? start));
  const first = open.map(() => 0);
  const repeated = taken(contexts, first);
  const next = await step.step({ word, ...repeated }, states);
  return { gains: rows(next.outputs.log_probabilities!), states: next.states };
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
  const ids = ranked(values).filter((id) => !banned.includes(id));
  return ids.slice(0, count);
}
