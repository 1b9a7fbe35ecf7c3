/* Motions drawn code by code: docs/bundle.md, the loop `codes`. */
import { integers, type NumberArray } from "./arrays.js";
import { type Arrays, type Graph, taken } from "./graph.js";
import type { Memory } from "./memory.js";
import type { Noise } from "./random.js";

/** Steps that the writer looks back at most. */
const WINDOW = 64;
/** Steps that a draw from memory compares. */
const RECENT = 3;

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
}

/** An action for log-probabilities (A), by the first number of a block of noise. */
export function drawnAction(source: Source, context: Float32Array, noise: Noise, certainty: number): number {
  const uniform = noise.uniform(source.parts + 2)[0]!;
  return nucleus(Array.from(context, (value) => certainty * value), uniform, 1, 1);
}

/** Steps of codes for each row, of its own action and noise: to its end, or of `longest` steps. */
export async function drawCodes(
  source: Source, actions: number[], noise: Noise[], drawing: Drawing, longest: number, exactly: boolean,
): Promise<number[][][]> {
  const found: number[][][] = actions.map(() => []);
  let rows = actions.map((_, row) => row);
  let last = [...rows, ...rows].map(() => [source.end + 1, ...Array<number>(source.parts - 1).fill(0)]);
  let age = rows.map(() => 0);
  let recent: Float32Array[][] = rows.map(() => []);
  let states = source.step.zeroState(2 * rows.length); // told the action, and not told
  for (let length = 0; length < longest && rows.length; length++) {
    const told = [...rows.map((row) => actions[row]!), ...rows.map(() => source.nullAction)];
    const inputs: Arrays = {
      codes: integers(last.flat(), last.length, source.parts),
      action: integers(told),
      age: integers([...age, ...age]),
    };
    const { outputs, states: next } = await source.step.step(inputs, states);
    const numbers = outputs.numbers!;
    const width = numbers.shape[1]!;
    if (length) recent = recent.map((before, row) => [numbers.data.slice(row * width, (row + 1) * width), ...before].slice(0, RECENT));
    const uniform = rows.map((row) => noise[row]!.uniform(source.parts + 2));
    const ends = !exactly && length > 0;
    const given = rows.map((row, at) => remembered(source, actions[row]!, recent[at]!, age[at]!, ends, uniform[at]!, drawing));
    const { codes, again } = await parts(source, outputs.known!, uniform.map((block) => block.slice(2)), given, age, ends, drawing);
    const going = codes.flatMap((step, at) => (step[0] === source.end ? [] : [at]));
    states = taken(lately(next), [...going, ...going.map((at) => at + rows.length)]);
    age = going.map((at) => (again[at] ? 0 : age[at]! + 1));
    recent = going.map((at) => recent[at]!);
    for (const at of going) found[rows[at]!]!.push(codes[at]!);
    last = [...going, ...going].map((at) => codes[at]!);
    rows = going.map((at) => rows[at]!);
  }
  return found;
}

/** A step from memory, or none where the net draws it. */
function remembered(
  { memory }: Source, action: number, recent: Float32Array[], age: number, ends: boolean, uniform: number[], drawing: Drawing,
): number[] | undefined {
  if (uniform[0]! >= drawing.memory || !memory.knows(action)) return undefined;
  return memory.codes(memory.next(action, recent, age, ends, uniform[1]!));
}

/** The codes of rows, one after the other where they are not given; and which rows begin their action again. */
async function parts(
  source: Source, known: NumberArray<Float32Array>, uniform: number[][], given: (number[] | undefined)[], age: number[],
  ends: boolean, drawing: Drawing,
): Promise<{ codes: number[][]; again: boolean[] }> {
  const again = given.map((step) => step?.[0] === source.end && !ends);
  const drawn = given.flatMap((step, row) => (step && !again[row] ? [] : [row]));
  const codes = given.map((step, row) => (step && !again[row] ? step : Array<number>(source.parts).fill(0)));
  for (let part = 0; drawn.length && part < source.parts; part++) {
    const rows = [...drawn, ...drawn.map((row) => row + given.length)];
    const asked = integers([...drawn, ...drawn].flatMap((row) => codes[row]!), rows.length, source.parts);
    const found = (await source.part.run({ known: taken({ known }, rows).known!, codes: asked })).log_probabilities!;
    const width = found.shape[2]!;
    const row = (at: number) => found.data.subarray((at * source.parts + part) * width, (at * source.parts + part + 1) * width);
    drawn.forEach((own, at) => {
      const [told, plain] = [row(at), row(at + drawn.length)];
      const chances = Array.from(told, (value, id) => plain[id]! + drawing.guidance * (value - plain[id]!));
      const temperature = age[own] === 0 ? drawing.first_temperature : drawing.temperature;
      let number = uniform[own]![part]!;
      if (part === 0 && !ends) {
        again[own] ||= nucleus(chances, number, temperature, drawing.top_p) === source.end;
        chances[source.end] = -Infinity;
        // the same number would give a neighbour of the end
        if (again[own]) number = (number * 1024) % 1;
      }
      codes[own]![part] = nucleus(chances, number, temperature, drawing.top_p);
    });
  }
  return { codes, again };
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
function lately(states: Record<string, NumberArray<Float32Array>>): Record<string, NumberArray<Float32Array>> {
  const found: Record<string, NumberArray<Float32Array>> = {};
  for (const [name, array] of Object.entries(states)) {
    const axis = array.shape.length - 2;
    const [steps, width] = [array.shape[axis]!, array.shape[axis + 1]!];
    if (steps <= WINDOW) {
      found[name] = array;
      continue;
    }
    const blocks = array.data.length / (steps * width);
    const data = new Float32Array(blocks * WINDOW * width);
    for (let block = 0; block < blocks; block++) {
      const stop = (block + 1) * steps * width;
      data.set(array.data.subarray(stop - WINDOW * width, stop), block * WINDOW * width);
    }
    found[name] = { data, shape: array.shape.with(axis, WINDOW) };
  }
  return found;
}
