import type { NumberArray } from "./arrays.js";
import { beamSearch, type Hypothesis, type Limits, scoreWords } from "./beam.js";
import type { Manifest } from "./bundle.js";
import { consensus } from "./consensus.js";
import type { Graph } from "./graph.js";
import { type Frames, LanguageModel } from "./model.js";
import { type Noise, Pcg64 } from "./random.js";
import { Vocabulary } from "./text.js";

/** How descriptions are found: by default as the bundle says. */
export interface DescribeSettings {
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

/** A sentence. score: by which it is ranked. confident: whether it is as probable as right ones are. */
export interface Description {
  text: string;
  logProbability: number;
  score: number;
  confident: boolean;
}

/** Sentences for a motion. */
export class DescribeModel extends LanguageModel {
  constructor(manifest: Manifest, private readonly graphs: Record<string, Graph>) {
    super(manifest);
  }

  /** Sentences that describe frames (T, D), best first. */
  async describe(frames: Frames, settings: DescribeSettings = {}): Promise<Description[]> {
    const least = this.manifest.settings.confidence?.log_probability ?? -5.5;
    const found = await this.hypotheses(frames, settings);
    return found.map(({ ids, logProbability, score }) => {
      return { text: this.vocabulary.decode(ids), logProbability, score, confident: logProbability >= least };
    });
  }

  /** The same as ids of words; noise: what draws are made by, instead of a seed. */
  async hypotheses(frames: Frames, settings: DescribeSettings = {}, noise?: Noise): Promise<Hypothesis[]> {
    const limits = this.limits(settings.maxWords);
    const beams = this.setting("beams", settings.beams ?? this.manifest.defaults.beams ?? 5);
    const draws = settings.draws ?? (this.manifest.loop === "consensus" ? (this.manifest.defaults.draws ?? 100) : undefined);
    if (draws === undefined) return beamSearch(this.graphs.step!, await this.context(frames), limits, beams);
    const given = noise ?? new Pcg64(this.setting("seed", settings.seed ?? 0));
    const temperature = this.setting("temperature", settings.temperature ?? this.manifest.defaults.temperature ?? 1);
    const context = await this.context(frames);
    const found = await consensus(this.graphs.step!, context, limits, this.setting("draws", draws), temperature, given);
    return found.slice(0, beams);
  }

  /** The log-probability of a sentence given frames (T, D). */
  async score(frames: Frames, text: string): Promise<number> {
    const { ids } = this.vocabulary.encode(text);
    return scoreWords(this.graphs.step!, await this.context(frames), this.limits(), ids);
  }

  private async context(frames: Frames): Promise<NumberArray<Float32Array>> {
    return (await this.graphs.encoder!.run(this.motion(frames))).context!;
  }

  private limits(maxWords?: number): Limits {
    return { start: Vocabulary.SOS, end: Vocabulary.EOS, banned: Vocabulary.BANNED, longest: this.setting("max_words", maxWords) };
  }
}
