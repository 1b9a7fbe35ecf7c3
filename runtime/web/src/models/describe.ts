import { DESCRIBE, confidenceSettings } from "../generated.js";
import { beamSearch, type Hypothesis, type Limits, scoreWords } from "../decode/beam.js";
import type { Manifest } from "../bundle/bundle.js";
import { consensus } from "../decode/consensus.js";
import { DecodingError } from "../errors.js";
import type { Arrays, Graph } from "../bundle/graph.js";
import { type Known, pathOf } from "./nearestNeighbour.js";
import { type Frames, LanguageModel } from "./base.js";
import { type Noise, Pcg64 } from "../decode/random.js";
import { Vocabulary } from "../text/vocabulary.js";

/** How descriptions are found: by default as the bundle says. */
export interface DescribeSettings {
  /** "known": sentences about known motions that are near, by default where the bundle has any and no draws are asked for. */
  decoding?: "known" | "beam" | "consensus";
  /** Sentences that are kept, and given. */
  beams?: number;
  /** Sentences that are drawn: the best agrees most with all of them, and need not be the most probable. */
  draws?: number;
  /** Of the draws, 0 by default. */
  seed?: number;
  /** Of the draws. */
  temperature?: number;
  maxWords?: number;
}

/**
 * A sentence and the logarithm of its probability: that it is right, where known motions answer, or else that it is said
 * in these words. score: by which it is ranked. confident: whether it is as probable as right ones are.
 */
export interface Description {
  text: string;
  logProbability: number;
  score: number;
  confident: boolean;
}

/** Sentences for a motion. */
export class DescribeModel extends LanguageModel {
  private readonly confidence = this.tuned("confidence", confidenceSettings);

  constructor(
    manifest: Manifest,
    graphs: Record<string, Graph>,
    private readonly known?: Known,
  ) {
    super(manifest, graphs);
  }

  /** Sentences that describe frames (T, D), best first. */
  async describe(frames: Frames, settings: DescribeSettings = {}): Promise<Description[]> {
    const decoding = settings.decoding ?? (this.known && settings.draws === undefined ? "known" : undefined);
    if (decoding === "known") return this.answers(frames, settings);
    const hypotheses = await this.hypotheses(frames, settings);
    return hypotheses.map(({ ids, logProbability, score }) => {
      return {
        text: this.vocabulary.decode(ids),
        logProbability,
        score,
        confident: logProbability >= this.confidence.log_probability,
      };
    });
  }

  /** What known motions answer. */
  private async answers(frames: Frames, settings: DescribeSettings): Promise<Description[]> {
    if (!this.known) throw new DecodingError("no motion is known: choose beam or consensus");
    if (settings.draws !== undefined)
      throw new DecodingError("known motions answer without draws: leave them out, or choose consensus");
    const beams = this.setting("beams", settings.beams);
    const { vector } = await this.graphs.space!.run(this.motion(frames));
    const { known, manifest } = this;
    const path = pathOf(frames, manifest.motion);
    const answers = known.answers(vector!.data, frames.length / this.fps, path, beams);
    return answers.map(({ text, probability }) => {
      const logProbability = Math.log(Math.max(probability, DESCRIBE.LEAST_PROBABILITY));
      return { text, logProbability, score: probability, confident: probability >= known.settings.sure };
    });
  }

  /** Sentences that are written, as ids of words; noise: what draws are made by, instead of a seed. */
  async hypotheses(frames: Frames, settings: DescribeSettings = {}, noise?: Noise): Promise<Hypothesis[]> {
    const limits = this.limits(settings.maxWords);
    const beams = this.setting("beams", settings.beams);
    const drawing = settings.decoding
      ? settings.decoding === "consensus"
      : this.manifest.loop === "consensus";
    const draws = settings.draws ?? (drawing ? this.setting("draws") : undefined);
    if (draws === undefined) return beamSearch(this.graphs.step!, await this.contexts(frames), limits, beams);
    const source = noise ?? new Pcg64(this.setting("seed", settings.seed ?? 0));
    const temperature = this.setting("temperature", settings.temperature);
    const contexts = await this.contexts(frames);
    const count = this.setting("draws", draws);
    const beginnings = await consensus(this.graphs.step!, contexts, limits, count, temperature, source);
    return beginnings.slice(0, beams);
  }

  /** The log-probability of a sentence given frames (T, D). */
  async score(frames: Frames, text: string): Promise<number> {
    const { ids } = this.vocabulary.encode(text);
    return scoreWords(this.graphs.step!, await this.contexts(frames), this.limits(), ids);
  }

  /** What the step takes of a motion: all inputs that the encoder takes or gives. */
  private async contexts(frames: Frames): Promise<Arrays> {
    const motion = this.motion(frames);
    const encoded: Arrays = { ...motion, ...(await this.graphs.encoder!.run(motion)) };
    const names = this.graphs.step!.spec.inputs.map(({ name }) => name).filter((name) => name in encoded);
    return Object.fromEntries(names.map((name) => [name, encoded[name]!]));
  }

  private limits(maxWords?: number): Limits {
    return {
      start: Vocabulary.SOS,
      end: Vocabulary.EOS,
      banned: Vocabulary.BANNED,
      longest: this.setting("max_words", maxWords),
    };
  }
}
