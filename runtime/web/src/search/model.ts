import { indexSettings } from "../generated.js";
import { type Frames, LanguageModel } from "../models/base.js";
import { rounded } from "../motion/numbers.js";

/** The index of a vector, how near it is (1 is the same), and whether it is like what was asked for at all, and not only nearer than others. */
export interface Hit {
  index: number;
  score: number;
  like: boolean;
}

/** Motions and sentences as vectors of length 1, near where they mean the same. */
export class SearchModel extends LanguageModel {
  private readonly index = this.tuned("index", indexSettings);

  /** The vector (E) of frames (T, D); one of more than ten seconds has the direction of the sum of its windows' vectors. */
  async embedMotion(frames: Frames): Promise<Float32Array> {
    const most = Math.floor(this.index.window * this.fps + 1e-9);
    const count = Math.max(1, Math.ceil(frames.length / most));
    const edges = Array.from({ length: count + 1 }, (_, at) => rounded((at * frames.length) / count));
    const vectors: Float32Array[] = [];
    for (const [at, edge] of edges.slice(1).entries()) {
      vectors.push((await this.graphs.motion!.run(this.motion(frames.slice(edges[at]!, edge)))).vector!.data);
    }
    if (count === 1) return vectors[0]!;
    const sum = vectors[0]!.map((_, i) => vectors.reduce((all, vector) => all + vector[i]!, 0));
    const length = Math.hypot(...sum);
    return sum.map((value) => value / length);
  }

  /** The vector (E) of a sentence. */
  async embedText(text: string): Promise<Float32Array> {
    return (await this.graphs.text!.run(this.words(text))).vector!.data;
  }

  /** The vectors of motions that are nearest to a sentence or to frames (T, D), best first; where the first is not `like` it, none is, and none is like a sentence with an unknown word. */
  async search(
    query: string | Frames,
    vectors: Float32Array[],
    count = this.setting("count"),
  ): Promise<Hit[]> {
    const isText = typeof query === "string";
    const isUnknown = isText && this.vocabulary.encode(query).unknown.length > 0;
    const least = isUnknown ? Infinity : isText ? this.index.like_text : this.index.like_motion;
    const vector = await (isText ? this.embedText(query) : this.embedMotion(query));
    return this.nearest(vector, vectors, count).map((hit) => ({ ...hit, like: hit.score >= least }));
  }

  /** The indices of the vectors nearest to one, and their scores, best first. */
  nearest(
    vector: Float32Array,
    vectors: Float32Array[],
    count = this.setting("count"),
  ): { index: number; score: number }[] {
    const scores = vectors.map((candidate, index) => ({
      index,
      score: candidate.reduce((sum, value, i) => sum + value * vector[i]!, 0),
    }));
    return scores
      .sort((a, b) => b.score - a.score || a.index - b.index)
      .slice(0, this.setting("count", count));
  }
}
