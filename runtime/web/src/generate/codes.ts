/* Motions drawn code by code: docs/reference/bundle.md, the loop `codes`. */
import { CODES } from "../generated.js";
import { integers, rows as rowsOf, stacked, type NumberArray } from "../bundle/arrays.js";
import { type Graph, taken, type Tensors } from "../bundle/graph.js";
import { type Memory } from "./memory.js";
import { most, ranked } from "../motion/numbers.js";
import type { Noise } from "../decode/random.js";

/** How codes are drawn. */
export const DRAWING = [
  "temperature",
  "first_temperature",
  "top_p",
  "guidance",
  "memory",
  "certainty",
] as const;
export type Drawing = Record<(typeof DRAWING)[number], number>;

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
  const certain = Array.from(context, (value) => certainty * value);
  return nucleus(certain, uniform, 1, 1);
}

/** The last codes of all rows, the actions that their next steps show, and steps since these began. */
interface Step {
  codes: number[][];
  actions: number[];
  ages: number[];
}

/** What a writer knows of its rows before a step. */
interface Known {
  age: number[];
  /** Of each row the share of its action's movement that is over. */
  done: number[];
  last: number[][];
  /** What the net knows of each row, twice: told the actions, and not told. */
  states: Tensors[];
  steps: Step[];
  /** How many of the last steps of each row the net has yet to read. */
  unread: number[];
  /** Of each row the numbers of its last steps, the latest first. */
  recent: Float32Array[][];
}

/**
 * Draws codes for rows, each of its own action and noise: all state of one request. The graph "step" reads a row's
 * steps when a net is to draw the next one: most steps are remembered, and need none.
 */
export class Writer {
  private now: Known;
  private before: Known;

  constructor(
    readonly source: Source,
    private noise: Noise[],
    private readonly drawing: Drawing,
  ) {
    const first = [source.end + 1, ...Array<number>(source.parts - 1).fill(0)];
    const zeros = noise.map(() => 0);
    const start = source.step.zeroState(2);
    this.now = {
      age: zeros,
      done: zeros,
      last: noise.map(() => first),
      states: noise.map(() => start),
      steps: [],
      unread: zeros,
      recent: noise.map(() => []),
    };
    this.before = this.now;
  }

  /** Take steps (N, P) as what every row did before, whatever action it was. */
  see(codes: number[][]): void {
    for (const step of codes) {
      this.advance(this.noise.map(() => this.source.nullAction));
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
    this.advance(actions);
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
      uniform.map((block) => block.slice(2)),
      remembered,
      ends,
      begun,
    );
    const age = from.map((before, row) => (again[row] ? 0 : before + 1));
    const done = after.map((state, row) => (again[row] ? 0 : (state?.done ?? this.now.done[row]!)));
    this.now = { ...this.now, last: codes, age, done };
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
    const of = <T>(values: T[]) => rows.map((row) => values[row]!);
    const { age, done, last, states, steps, unread, recent } = this.now;
    this.noise = of(this.noise);
    this.now = {
      age: of(age),
      done: of(done),
      last: of(last),
      states: of(states),
      steps: steps.map(({ codes, actions, ages }) => ({
        codes: of(codes),
        actions: of(actions),
        ages: of(ages),
      })),
      unread: of(unread),
      recent: of(recent),
    };
  }

  /** Put the last step behind each row, whose next one shows an action. */
  private advance(actions: number[]): void {
    const { age, last, steps, unread, recent } = (this.before = this.now);
    const { end, memory } = this.source;
    const started = last[0]![0] !== end + 1;
    this.now = {
      ...this.now,
      steps: [...steps, { codes: last, actions, ages: age }].slice(-CODES.WINDOW),
      unread: unread.map((count) => Math.min(count + 1, CODES.WINDOW)),
      recent: recent.map((before, row) =>
        started ? [memory.numbersOf(last[row]!), ...before].slice(0, memory.settings.past_steps) : before,
      ),
    };
  }

  /**
   * What the parts have to know (2 R, H) of the next step of rows: all told their actions, then all not. Rows that have
   * as many unread steps are read together.
   */
  private async known(rows: number[]): Promise<NumberArray<Float32Array>> {
    const known = Array<Float32Array>(2 * rows.length);
    const counts = rows.map((row) => this.now.unread[row]!);
    for (const count of new Set(counts)) {
      const group = rows.flatMap((_, at) => (counts[at] === count ? [at] : []));
      const members = group.map((at) => rows[at]!);
      const read = await this.read(members, count);
      group.forEach((at, place) => {
        known[at] = read[2 * place]!;
        known[rows.length + at] = read[2 * place + 1]!;
      });
    }
    return stacked(known);
  }

  /** Read the last steps of rows, `count` each; of each row twice, told the actions and not told. */
  private async read(rows: number[], count: number): Promise<Float32Array[]> {
    const { step, written, nullAction, parts } = this.source;
    const steps = this.now.steps.slice(-count);
    const both = rows.flatMap((row) => [row, row]);
    const of = (value: (step: Step, row: number, at: number) => number | number[], ...shape: number[]) => {
      const values = both.flatMap((row, at) => steps.flatMap((step) => value(step, row, at)));
      return integers(values, both.length, count, ...shape);
    };
    const inputs = {
      codes: of(({ codes }, row) => codes[row]!, parts),
      action: of(({ actions }, row, at) => (at % 2 ? nullAction : written[actions[row]!]!)),
      age: of(({ ages }, row) => ages[row]!),
    };
    const window: Tensors = {};
    for (const name of Object.keys(step.spec.feedback)) {
      const kept = rows.map((row) => lately(this.now.states[row]![name]!, CODES.WINDOW - count));
      const data = kept.map((state) => state.data);
      window[name] = stacked(data, both.length, ...kept[0]!.shape.slice(1));
    }
    const next = await step.step(inputs, window);
    const states = [...this.now.states];
    const unread = [...this.now.unread];
    rows.forEach((row, place) => {
      states[row] = taken(next.states, [2 * place, 2 * place + 1]);
      unread[row] = 0;
    });
    this.now = { ...this.now, states, unread };
    return rowsOf(next.outputs.known!);
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
    const { memory, written } = this.source;
    const { age, done, recent } = this.now;
    const share = this.drawing.memory;
    const isCommand = written[action] !== action;
    const continues = uniform[0]! < share || (((isCommand && ends) || steps > 0) && share > 0);
    if (!continues || !memory.knows(action)) return undefined;
    if (steps) return memory.busiest(action, recent[row]!, steps, uniform[1]!);
    return memory.next(action, recent[row]!, age[row]!, ends, uniform[1]!, done[row]!, whole);
  }

  /**
   * The codes of rows, one after the other where they are not given; and which rows begin their action again.
   * begun: rows that do not end yet.
   */
  private async drawn(
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
    const known = drawn.length ? await this.known(drawn) : undefined;
    for (let part = 0; known && part < source.parts; part++) {
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
    const drawn = [...rows, ...rows].flatMap((row) => codes[row]!);
    const inputs = { known, codes: integers(drawn, 2 * rows.length, parts) };
    const { data, shape } = (await graph.run(inputs)).log_probabilities!;
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
  const highest = most(logWeights);
  const weights = logWeights.map((value) => Math.exp((value - highest) / temperature));
  const order = ranked(weights);
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

/** A state that grows, cut to its last steps. */
function lately(array: NumberArray<Float32Array>, most: number): NumberArray<Float32Array> {
  const axis = array.shape.length - 2;
  const steps = array.shape[axis]!;
  const width = array.shape[axis + 1]!;
  if (steps <= most) return array;
  const blocks = array.data.length / (steps * width);
  const data = new Float32Array(blocks * most * width);
  for (let block = 0; block < blocks; block++) {
    const stop = (block + 1) * steps * width;
    data.set(array.data.subarray(stop - most * width, stop), block * most * width);
  }
  return { data, shape: array.shape.with(axis, most) };
}
