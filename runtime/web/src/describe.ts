import { type BeamSettings, beamSearch, type Hypothesis } from "./beam.js";
import type { Manifest } from "./bundle.js";
import type { Graph } from "./graph.js";
import { type Frames, LanguageModel } from "./model.js";
import { Vocabulary } from "./text.js";

/** Sentences for a motion. */
export class DescribeModel extends LanguageModel {
  constructor(manifest: Manifest, private readonly graphs: Record<string, Graph>) {
    super(manifest);
  }

  /** Sentences that describe frames (T, D), the most probable first. */
  async describe(frames: Frames, settings: { beams?: number; maxWords?: number } = {}): Promise<{ text: string; logProbability: number }[]> {
    const found = await this.hypotheses(frames, settings);
    return found.map(({ ids, logProbability }) => ({ text: this.vocabulary.decode(ids), logProbability }));
  }

  /** The same as ids of words. */
  async hypotheses(frames: Frames, { beams, maxWords }: { beams?: number; maxWords?: number } = {}): Promise<Hypothesis[]> {
    const { context } = await this.graphs.encoder!.run(this.motion(frames));
    const settings: BeamSettings = {
      start: Vocabulary.SOS,
      end: Vocabulary.EOS,
      banned: Vocabulary.BANNED,
      longest: this.setting("max_words", maxWords),
      beams: this.setting("beams", beams),
    };
    return beamSearch(this.graphs.step!, context!, settings);
  }
}
