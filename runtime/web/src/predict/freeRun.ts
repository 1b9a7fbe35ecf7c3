import { batched, type NumberArray } from "../bundle/arrays.js";
import type { Arrays, Graph, Tensors } from "../bundle/graph.js";

/** The frames that follow seed frames (L, D): docs/reference/bundle.md, the loop `free_run`. */
export async function freeRun(
  encoder: Graph,
  step: Graph,
  seed: ArrayLike<number>[],
  frames: number,
  horizon: number,
) {
  const seen = [...seed];
  const width = seed[0]!.length;
  const takes = (name: string) => step.spec.inputs.some((input) => input.name === name);
  while (seen.length < seed.length + frames) {
    const ahead = Math.min(horizon, seed.length + frames - seen.length);
    const outputs = await encoder.run({ frames: batched(seen.slice(-seed.length)) });
    const whole = outputs.trajectory as NumberArray<Float32Array> | undefined;
    if (whole && whole.shape[1]! >= ahead) {
      for (let at = 0; at < ahead; at++) seen.push(whole.data.slice(at * width, (at + 1) * width));
      continue;
    }
    const kept = Object.entries(outputs).filter(([name]) => takes(name));
    const fixed: Arrays = Object.fromEntries(kept.filter(([name]) => !(name in step.spec.feedback)));
    let states: Tensors = {
      ...step.zeroState(1),
      ...Object.fromEntries(kept.filter(([name]) => name in step.spec.feedback)),
    };
    for (let at = 0; at < ahead; at++) {
      const next = await step.step(fixed, states);
      states = next.states;
      seen.push(next.outputs.frame!.data);
    }
  }
  return seen.slice(seed.length) as Float32Array[];
}
