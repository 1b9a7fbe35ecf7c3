/* What the models of all verbs share: their manifest, settings, and checks of what they are given. */
import {
  LANGUAGE,
  PREDICT,
  betweenSettings,
  codesSettings,
  consensusSettings,
  freeRunSettings,
  nearestSettings,
} from "../generated.js";
import { batched, integers } from "../bundle/arrays.js";
import type { Manifest } from "../bundle/bundle.js";
import type { Graph } from "../bundle/graph.js";
import { BundleError, DecodingError } from "../errors.js";
import { fits, type Range, type Settings, settingsOf } from "../settings.js";
import { Vocabulary } from "../text/vocabulary.js";

/** Frames in the channels and units of a model's contract (`manifest.motion`), one row each. */
export type Frames = ArrayLike<number>[];

/** Settings by name, with their ranges. */
const RANGES: Record<string, Range> = {
  ...consensusSettings,
  ...codesSettings,
  ...freeRunSettings,
  ...betweenSettings,
  count: { ...nearestSettings.count, high: 1_000_000 },
  seconds: { ...codesSettings.seconds, low: 1e-3 },
  seed: { default: null, low: 0, high: Number.MAX_SAFE_INTEGER, whole: true },
  frames: { default: null, low: 1, high: PREDICT.MAX_FRAMES, whole: true },
};

export abstract class Model {
  constructor(
    readonly manifest: Manifest,
    protected readonly graphs: Record<string, Graph> = {},
  ) {}

  /** Frames a second of all that goes in and comes out. */
  get fps(): number {
    return this.manifest.motion.fps;
  }

  /** The tuned numbers of a feature. */
  protected tuned<Ranges extends Record<string, Range>>(feature: string, ranges: Ranges): Settings<Ranges> {
    return settingsOf(feature, ranges, this.manifest.settings[feature]);
  }

  protected checked(frames: Frames, width: number, least = 1): Frames {
    const fits = frames.every((frame) => frame.length === width && Array.from(frame).every(Number.isFinite));
    if (frames.length < least || !fits)
      throw new DecodingError(`at least ${least} frames of ${width} finite numbers are needed`);
    return frames;
  }

  /** A setting that is given, or else the bundle's default, or the usual one; DecodingError where it is out of range. */
  protected setting(name: string, choice?: number): number {
    const range = RANGES[name]!;
    const value = choice ?? this.manifest.defaults[name] ?? range.default;
    if (value === null || !fits(value, range)) {
      throw new DecodingError(
        `${name} must be ${range.whole ? "a whole number " : ""}from ${range.low} to ${range.high}, not ${value}`,
      );
    }
    return value;
  }
}

export abstract class LanguageModel extends Model {
  readonly vocabulary: Vocabulary;

  constructor(manifest: Manifest, graphs?: Record<string, Graph>) {
    super(manifest, graphs);
    if (!manifest.vocabulary || !manifest.text)
      throw new BundleError(`the bundle ${manifest.name} has no words`);
    this.vocabulary = new Vocabulary(manifest.vocabulary, manifest.text, manifest.common);
  }

  protected words(sentence: string) {
    const { ids } = this.vocabulary.encode(sentence);
    return { words: integers(ids, 1, ids.length), lengths: integers([ids.length]) };
  }

  protected motion(frames: Frames) {
    const checked = this.checked(frames, this.manifest.motion.channels.length, 2);
    const most = Math.floor(LANGUAGE.MAX_SECONDS * this.fps + 1e-9) + 1;
    if (checked.length > most)
      throw new DecodingError(
        `the motion has ${checked.length} frames, but the model takes at most ${most}: cut it`,
      );
    return { frames: batched(checked), lengths: integers([checked.length]) };
  }
}
