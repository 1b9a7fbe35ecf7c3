import type { Manifest } from "./bundle.js";
import type { Graph } from "./graph.js";
import { type Frames, LanguageModel } from "./model.js";

/** Motions and sentences as vectors of length 1, near where they mean the same. */
export class SearchModel extends LanguageModel {
  constructor(manifest: Manifest, private readonly graphs: Record<string, Graph>) {
    super(manifest);
  }

  async embedMotion(frames: Frames): Promise<Float32Array> {
    return (await this.graphs.motion!.run(this.motion(frames))).vector!.data;
  }

  async embedText(text: string): Promise<Float32Array> {
    return (await this.graphs.text!.run(this.words(text))).vector!.data;
  }

  /** The indices of the vectors nearest to one, and their scores, best first. */
  nearest(vector: Float32Array, vectors: Float32Array[], count = this.setting("count")): { index: number; score: number }[] {
    const scores = vectors.map((one, index) => ({ index, score: one.reduce((sum, value, i) => sum + value * vector[i]!, 0) }));
    return scores.sort((a, b) => b.score - a.score || a.index - b.index).slice(0, this.setting("count", count));
  }
}
