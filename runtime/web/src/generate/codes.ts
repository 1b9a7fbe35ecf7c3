/* Motions drawn code by code: docs/reference/bundle.md, the loop `codes`. */
import { CODES } from "../generated.js";
import { integers, type NumberArray } from "../bundle/arrays.js";
import { type Graph, taken } from "../bundle/graph.js";
import { type Memory } from "./memory.js";
import type { Noise } from "../decode/random.js";

/** How codes are drawn. */
export interface Drawing {
  temperature: number;
  first_temperature: number;
  top_p: number;
  guidance: number;
  memory: number;
  certainty: number;
}

/** What codes are drawn from. end: the move that ends a motion; nullAction: the action that says nothing. */
export interface Source {
  step: Graph;
  part: Graph;
  end: number;
  nullAction: number;
  parts: number;
  memory: Memory;
  /** The action that the graph step knows each one as; other than itself for those of commands. */
  written: number[];
}

/** An action for log-probabilities (A), by the first number of a block of noise. */
export function drawnAction(
  source: Source,
  context: ArrayLike<number>,
  noise: Noise,
  certainty: number,
): number {
  const uniform = noise.uniform(source.parts + 2)[0]!;
  return nucleus(
    Array.from(context, (value) => certainty * value),
    uniform,
    1,
    1,
  );
}

/** What a writer knows of its rows before a step; `last` and `states` twice, told the action and not told. */
interface Known {
  age: number[];
  /** Of each row the share of its action's movement that is over. */
  done: number[];
  last: number[][];
  states: Record<string, NumberArray<Float32Array>>;
  /** Of each row the numbers of its last steps, the latest first. */
  recent: Float32Array[][];
}

/** Draws codes for rows, each of its own action and noise: all state of one request. */
export class Writer {
  private now: Known;
  private before: Known;

  constructor(
    readonly source: Source,
    private noise: Noise[],
    private readonly drawing: Drawing,
  ) {
    const first = [source.end + 1, ...Array<number>(source.parts - 1).fill(0)];
    const rows = noise.length;
    const last = Array<number[]>(2 * rows).fill(first);
    const zeros = noise.map(() => 0);
    this.now = {
      age: zeros,
      done: zeros,
      last,
      states: source.step.zeroState(2 * rows),
      recent: noise.map(() => []),
    };
    this.before = this.now;
  }

  /** Take steps (N, P) as what every row did before, whatever action it was. */
  async see(codes: number[][]): Promise<void> {
    for (const step of codes) {
      await this.known(this.noise.map(() => this.source.nullAction));
      this.now = { ...this.now, last: this.now.last.map(() => step) };
    }
  }

  /** Other actions begin. */
  begin(): void {
    const zeros = this.now.age.map(() => 0);
    this.now = { ...this.now, age: zeros, done: zeros };
  }

  /**
   * The next step (B, P) of rows with the given actions. ends: whether a motion may end, but no more than
   * `skip` sooner than any remembered one; else an action that would end begins again.
   * steps: of this and those to come, where they are to show the most of an action that begins; else 0. whole: as for
   * the memory's `next`.
   */
  async draw(actions: number[], ends: boolean, steps: number, whole: boolean): Promise<number[][]> {
    const known = await this.known(actions);
    const uniform = this.noise.map((noise) => noise.uniform(this.source.parts + 2));
    const { memory } = this.source;
    const places = actions.map((action, row) =>
      this.remembered(action, row, ends, steps, whole, uniform[row]!),
    );
    const from = places.map((place, row) =>
      steps && place !== undefined ? memory.ages[place]! : this.now.age[row]!,
    );
    this.now = { ...this.now, age: from };
    const after = places.map((place, row) =>
      place === undefined ? undefined : memory.after(actions[row]!, place, whole),
    );
    const remembered = places.map((place, row) =>
      place === undefined ? undefined : this.step(place, ends && after[row]!.end),
    );
    const begun = actions.map(
      (action, row) => from[row]! < (1 - memory.settings.skip) * (memory.shortest.get(action) ?? 0),
    );
    const { codes, again } = await this.drawn(
      known,
      uniform.map((block) => block.slice(2)),
      remembered,
      ends,
      begun,
    );
    const age = from.map((before, row) => (again[row] ? 0 : before + 1));
    const done = after.map((state, row) => (again[row] ? 0 : (state?.done ?? this.now.done[row]!)));
    this.now = { ...this.now, last: [...codes, ...codes], age, done };
    return codes;
  }

  /** The codes of a remembered step, or of an end. */
  private step(place: number, end: boolean): number[] {
    const [move, ...body] = this.source.memory.codes(place);
    return [end ? this.source.end : move!, ...body];
  }

  /** Undo the last draw, such as that of an end. */
  takeBack(): void {
    this.now = this.before;
  }

  /** Go on with some of the rows only. */
  keep(rows: number[]): void {
    const { age, done, last, states, recent } = this.now;
    const both = [...rows, ...rows.map((row) => row + this.noise.length)];
    this.noise = rows.map((row) => this.noise[row]!);
    this.now = {
      age: rows.map((row) => age[row]!),
      done: rows.map((row) => done[row]!),
      last: both.map((row) => last[row]!),
      states: taken(states, both),
      recent: rows.map((row) => recent[row]!),
    };
  }

  /** What the step makes of the last codes, and of all before: (2 B, H). */
  private async known(actions: number[]): Promise<NumberArray<Float32Array>> {
    const { age, done, last, states, recent } = (this.before = this.now);
    const inputs = {
      codes: integers(last.flat(), last.length, this.source.parts),
      action: integers([
        ...actions.map((action) => this.source.written[action]!),
        ...actions.map(() => this.source.nullAction),
      ]),
      age: integers([...age, ...age]),
    };
    const { outputs, states: next } = await this.source.step.step(inputs, states);
    const { data, shape } = outputs.numbers!;
    const row = (at: number) => data.slice(at * shape[1]!, (at + 1) * shape[1]!);
    const started = last[0]![0] !== this.source.end + 1;
    const latest = started
      ? recent.map((before, at) => [row(at), ...before].slice(0, this.source.memory.settings.past_steps))
      : recent;
    this.now = { age, done, last, states: lately(next), recent: latest };
    return outputs.known!;
  }

  /** A row of the memory that is gone on with, or none where the net draws the step. */
  private remembered(
    action: number,
    row: number,
    ends: boolean,
    steps: number,
    whole: boolean,
    uniform: number[],
  ): number | undefined {
    const { memory } = this.source;
    const { age, done, recent } = this.now;
    const share = this.drawing.memory;
    if (!(uniform[0]! < share || (steps && share > 0)) || !memory.knows(action)) return undefined;
    if (steps) return memory.busiest(action, recent[row]!, steps, uniform[1]!);
    return memory.next(action, recent[row]!, age[row]!, ends, uniform[1]!, done[row]!, whole);
  }

  /**
   * The codes of rows, one after the other where they are not given; and which rows begin their action again.
   * begun: rows that do not end yet.
   */
  private async drawn(
    known: NumberArray<Float32Array>,
    uniform: number[][],
    remembered: (number[] | undefined)[],
    ends: boolean,
    begun: boolean[],
  ): Promise<{ codes: number[][]; again: boolean[] }> {
    const { source, drawing } = this;
    const again = remembered.map((step) => step?.[0] === source.end && !ends);
    const drawn = remembered.flatMap((step, row) => (step && !again[row] ? [] : [row]));
    const codes = remembered.map((step, row) =>
      step && !again[row] ? step : Array<number>(source.parts).fill(0),
    );
    for (let part = 0; drawn.length && part < source.parts; part++) {
      const chances = await this.chances(known, codes, drawn, part);
      drawn.forEach((row, at) => {
        const temperature = this.now.age[row] === 0 ? drawing.first_temperature : drawing.temperature;
        const chance = chances[at]!;
        let number = uniform[row]![part]!;
        if (part === 0 && (!ends || begun[row])) {
          const ended = nucleus(chance, number, temperature, drawing.top_p) === source.end;
          again[row] ||= ended && !ends;
          chance[source.end] = -Infinity;
          // the same number would give a neighbour of the end
          if (again[row] || ended) number = (number * 1024) % 1;
        }
        codes[row]![part] = nucleus(chance, number, temperature, drawing.top_p);
      });
    }
    return { codes, again };
  }

  /** Of some rows the log-weights of a part, the action followed as far as `guidance` says. */
  private async chances(
    known: NumberArray<Float32Array>,
    codes: number[][],
    rows: number[],
    part: number,
  ): Promise<number[][]> {
    const { part: graph, parts } = this.source;
    const both = [...rows, ...rows.map((row) => row + codes.length)];
    const actions = integers(
      [...rows, ...rows].flatMap((row) => codes[row]!),
      both.length,
      parts,
    );
    const { data, shape } = (await graph.run({ known: taken({ known }, both).known!, codes: actions }))
      .log_probabilities!;
    const of = (at: number) =>
      data.subarray((at * parts + part) * shape[2]!, (at * parts + part + 1) * shape[2]!);
    return rows.map((_, at) => {
      const conditional = of(at);
      const plain = of(at + rows.length);
      return Array.from(
        conditional,
        (value, id) => plain[id]! + this.drawing.guidance * (value - plain[id]!),
      );
    });
  }
}

/**
 * Step by step the rows that have not ended, and their codes (R, P), up to `longest` steps. exactly: none ends before.
 * A writer whose rows have all ended can draw other actions from there.
 */
export async function* drawnSteps(writer: Writer, actions: number[], longest: number, exactly: boolean) {
  let rows = actions.map((_, row) => row);
  writer.begin();
  for (let length = 0; length < longest; length++) {
    const steps = exactly && !length ? longest : 0;
    const codes = await writer.draw(
      rows.map((row) => actions[row]!),
      !exactly && length > 0,
      steps,
      exactly,
    );
    const going = codes.flatMap((step, at) => (step[0] === writer.source.end ? [] : [at]));
    if (!going.length) return writer.takeBack();
    if (going.length < rows.length) writer.keep(going);
    rows = going.map((at) => rows[at]!);
    yield { rows, codes: going.map((at) => codes[at]!) };
  }
}

/** Steps of codes for each row, of its own action: to its end, or of `longest` steps. */
export async function drawCodes(
  writer: Writer,
  actions: number[],
  longest: number,
  exactly: boolean,
): Promise<number[][][]> {
  const drawn: number[][][] = actions.map(() => []);
  for await (const { rows, codes } of drawnSteps(writer, actions, longest, exactly)) {
    rows.forEach((row, at) => drawn[row]!.push(codes[at]!));
  }
  return drawn;
}

/** One of the likeliest things that make up `topP` together, by a uniform number. */
function nucleus(logWeights: number[], uniform: number, temperature: number, topP: number): number {
  const most = logWeights.reduce((a, b) => Math.max(a, b));
  const weights = logWeights.map((value) => Math.exp((value - most) / temperature));
  const order = weights.map((_, id) => id).sort((a, b) => weights[b]! - weights[a]! || a - b);
  const all = order.reduce((sum, id) => sum + weights[id]!, 0);
  const inside = new Set<number>();
  for (let sum = 0, at = 0; at < order.length && sum < topP * all; at++) {
    inside.add(order[at]!);
    sum += weights[order[at]!]!;
  }
  let sum = 0;
  const places = weights.map((weight, id) => (sum += inside.has(id) ? weight : 0));
  return places.findIndex((place) => place > uniform * sum);
}

/** States that grow, cut to the last steps. */
function lately(
  states: Record<string, NumberArray<Float32Array>>,
): Record<string, NumberArray<Float32Array>> {
  const doubled: Record<string, NumberArray<Float32Array>> = {};
  for (const [name, array] of Object.entries(states)) {
    const axis = array.shape.length - 2;
    const steps = array.shape[axis]!;
    const width = array.shape[axis + 1]!;
    if (steps <= CODES.WINDOW) {
      doubled[name] = array;
      continue;
    }
    const blocks = array.data.length / (steps * width);
    const data = new Float32Array(blocks * CODES.WINDOW * width);
    for (let block = 0; block < blocks; block++) {
      const stop = (block + 1) * steps * width;
      data.set(array.data.subarray(stop - CODES.WINDOW * width, stop), block * CODES.WINDOW * width);
    }
    doubled[name] = { data, shape: array.shape.with(axis, CODES.WINDOW) };
  }
  return doubled;
}
