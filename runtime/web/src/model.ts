/* What the models of all verbs share: their manifest, settings, and checks of what they are given. */
import { integers, stacked } from "./arrays.js";
import type { Manifest } from "./bundle.js";
import { BundleError, DecodingError } from "./errors.js";
import { Vocabulary } from "./text.js";

/** Frames in the channels and units of a model's contract (`manifest.motion`), one row each. */
export type Frames = ArrayLike<number>[];

/** The longest motion that is described. */
const MAX_SECONDS = 30;

/** Of each setting the least and the most, and whether it is a whole number. */
const RANGES: Record<string, [number, number, boolean]> = {
  max_words: [1, 1000, true],
  beams: [1, 100, true],
  draws: [1, 1000, true],
  seed: [0, Number.MAX_SAFE_INTEGER, true],
  hypotheses: [1, 100, true],
  seconds: [1e-3, 600, false],
  max_seconds: [0, 600, false],
  temperature: [0.01, 100, false],
  first_temperature: [0.01, 100, false],
  top_p: [0.01, 1, false],
  guidance: [0, 10, false],
  memory: [0, 1, false],
  certainty: [0.01, 100, false],
  frames: [1, 100_000, true],
  horizon: [1, 1000, true],
  context: [1, 1000, true],
  least: [1, 1000, true],
  longest: [1, 1000, true],
  count: [1, 1_000_000, true],
};

export abstract class Model {
  constructor(readonly manifest: Manifest) {}

  /** Frames a second of all that goes in and comes out. */
  get fps(): number {
    return this.manifest.motion.fps;
  }

  protected checked(frames: Frames, width: number, least = 1): Frames {
    const fits = frames.every((frame) => frame.length === width && Array.from(frame).every(Number.isFinite));
    if (frames.length < least || !fits) throw new DecodingError(`at least ${least} frames of ${width} finite numbers are needed`);
    return frames;
  }

  /** A setting that is given, or else the bundle's default; DecodingError where it is out of range. */
  protected setting(name: string, given?: number): number {
    const value = given ?? this.manifest.defaults[name];
    const [least, most, whole] = RANGES[name]!;
    if (value === undefined || !(value >= least && value <= most) || (whole && !Number.isInteger(value))) {
      throw new DecodingError(`${name} must be ${whole ? "a whole number " : ""}from ${least} to ${most}, not ${value}`);
    }
    return value;
  }
}

export abstract class LanguageModel extends Model {
  readonly vocabulary: Vocabulary;

  constructor(manifest: Manifest) {
    super(manifest);
    if (!manifest.vocabulary || !manifest.text) throw new BundleError(`the bundle ${manifest.name} has no words`);
    this.vocabulary = new Vocabulary(manifest.vocabulary, manifest.text, manifest.common);
  }

  protected words(sentence: string) {
    const { ids } = this.vocabulary.encode(sentence);
    return { words: integers(ids, 1, ids.length), lengths: integers([ids.length]) };
  }

  protected motion(frames: Frames) {
    const given = this.checked(frames, this.manifest.motion.channels.length, 2);
    const most = Math.floor(MAX_SECONDS * this.fps + 1e-9) + 1;
    if (given.length > most) throw new DecodingError(`the motion has ${given.length} frames, but the model takes at most ${most}: cut it`);
    return { frames: stacked(given, 1, given.length, given[0]!.length), lengths: integers([given.length]) };
  }
}
