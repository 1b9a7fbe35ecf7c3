import { batched } from "../bundle/arrays.js";
import { DecodingError } from "../errors.js";
import { freeRun } from "./freeRun.js";
import { type Frames, Model } from "../models/base.js";

/** The frames that follow a motion. */
export class PredictModel extends Model {
  /** The next frames after the last ones of (T, D); by default one horizon. */
  async predict(frames: Frames, count = this.setting("horizon")): Promise<Float32Array[]> {
    const { encoder, step } = this.graphs;
    const seed = this.seed(frames);
    return freeRun(encoder!, step!, seed, this.setting("frames", count), this.setting("horizon"));
  }

  /** For each frame of a horizon how far its joints are expected to be off, on average, in centimetres. */
  async expectedErrors(frames: Frames): Promise<Float32Array> {
    const { encoder, error } = this.graphs;
    if (!error) throw new DecodingError(`the bundle ${this.manifest.name} does not estimate its errors`);
    const known = { frames: batched(this.seed(frames)) };
    const metres = (await error.run({ ...known, ...(await encoder!.run(known)) })).error!.data;
    return metres.map((metre) => 100 * metre);
  }

  /** The last frames, as many as the encoder takes. */
  private seed(frames: Frames): Frames {
    const { shape } = this.graphs.encoder!.spec.inputs[0]!;
    return this.checked(frames, Number(shape[2]), Number(shape[1])).slice(-Number(shape[1]));
  }
}
