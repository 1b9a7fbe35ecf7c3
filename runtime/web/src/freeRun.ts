import { type NumberArray, stacked } from "./arrays.js";
import type { Arrays, Graph } from "./graph.js";

/** The frames that follow seed frames (L, D): docs/bundle.md, the loop `free_run`. */
export async function freeRun(encoder: Graph, step: Graph, seed: ArrayLike<number>[], frames: number, horizon: number) {
  const seen = [...seed];
  const found: Float32Array[] = [];
  const takes = (name: string) => step.spec.inputs.some((input) => input.name === name);
  while (found.length < frames) {
    const latest = stacked(seen.slice(-seed.length), 1, seed.length, seed[0]!.length);
    const given = Object.entries(await encoder.run({ frames: latest })).filter(([name]) => takes(name));
    const fixed: Arrays = Object.fromEntries(given.filter(([name]) => !(name in step.spec.feedback)));
    let states: Record<string, NumberArray<Float32Array>> = { ...step.zeroState(1), ...Object.fromEntries(given.filter(([name]) => name in step.spec.feedback)) };
    for (let at = 0; at < horizon && found.length < frames; at++) {
      const next = await step.step(fixed, states);
      states = next.states;
      found.push(next.outputs.frame!.data);
      seen.push(next.outputs.frame!.data);
    }
  }
  return found;
}
