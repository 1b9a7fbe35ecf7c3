import { between } from "./between.js";
import { DecodingError } from "../errors.js";
import { type Frames, Model } from "../models/base.js";

/** The frames of a gap. */
export class FillModel extends Model {
  /** The frames between those before a gap (P, E) and those after it (A, E), all placed (docs/reference/bundle.md, Fill). */
  async fill(past: Frames, after: Frames, count: number): Promise<Float64Array[]> {
    const width = Number(this.graphs.filler!.spec.inputs[0]!.shape[2]);
    const least = this.setting("least");
    const context = this.setting("context");
    if (!(count >= 1 && count <= this.setting("longest"))) {
      throw new DecodingError(`a gap has 1 to ${this.setting("longest")} frames, not ${count}`);
    }
    const before = this.checked(past, width, least).slice(-context);
    const behind = this.checked(after, width, least).slice(0, context);
    return between(this.graphs.filler!, before, behind, count);
  }
}
