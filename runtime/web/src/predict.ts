import type { Manifest } from "./bundle.js";
import { freeRun } from "./freeRun.js";
import type { Graph } from "./graph.js";
import { type Frames, Model } from "./model.js";

/** The frames that follow a motion. */
export class PredictModel extends Model {
  constructor(manifest: Manifest, private readonly graphs: Record<string, Graph>) {
    super(manifest);
  }

  /** The next frames after the last ones of (T, D); by default one horizon. */
  async predict(frames: Frames, count = this.setting("horizon")): Promise<Float32Array[]> {
    const { shape } = this.graphs.encoder!.spec.inputs[0]!;
    const seed = this.checked(frames, Number(shape[2]), Number(shape[1])).slice(-Number(shape[1]));
    return freeRun(this.graphs.encoder!, this.graphs.step!, seed, this.setting("frames", count), this.setting("horizon"));
  }
}
