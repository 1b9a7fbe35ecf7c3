import { integers, stacked } from "./arrays.js";
import { type BeamSettings, beamSearch, type Hypothesis } from "./beam.js";
import { between } from "./between.js";
import { Bundle, type Manifest } from "./bundle.js";
import { drawCodes, drawnAction, type Drawing, type Source } from "./codes.js";
import { framesOf } from "./decodeCodes.js";
import { BundleError, DecodingError } from "./errors.js";
import { freeRun } from "./freeRun.js";
import type { Graph, SessionSettings } from "./graph.js";
import { Memory } from "./memory.js";
import { type Noise, Pcg64 } from "./random.js";
import { Vocabulary } from "./text.js";

/** Frames in the channels and units of a model's contract (`manifest.motion`), one row each. */
export type Frames = ArrayLike<number>[];

/** Of each setting the least and the most, and whether it is a whole number. */
const RANGES: Record<string, [number, number, boolean]> = {
  max_words: [1, 1000, true],
  beams: [1, 100, true],
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

abstract class Model {
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

abstract class LanguageModel extends Model {
  readonly vocabulary: Vocabulary;

  constructor(manifest: Manifest) {
    super(manifest);
    if (!manifest.vocabulary || !manifest.text) throw new BundleError(`the bundle ${manifest.name} has no words`);
    this.vocabulary = new Vocabulary(manifest.vocabulary, manifest.text);
  }

  protected words(sentence: string) {
    const { ids } = this.vocabulary.encode(sentence);
    return { words: integers(ids, 1, ids.length), lengths: integers([ids.length]) };
  }

  protected motion(frames: Frames) {
    const given = this.checked(frames, this.manifest.motion.channels.length, 2);
    return { frames: stacked(given, 1, given.length, given[0]!.length), lengths: integers([given.length]) };
  }
}

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

export interface GenerateSettings extends Partial<Drawing> {
  seed?: number;
  hypotheses?: number;
  /** The exact length; by default a motion ends by itself. */
  seconds?: number;
  max_seconds?: number;
}

/** Motions for a sentence, drawn as codes. */
export class GenerateModel extends LanguageModel {
  constructor(
    manifest: Manifest,
    private readonly graphs: Record<string, Graph>,
    private readonly source: Source,
  ) {
    super(manifest);
  }

  /** Motions as frames (T, D) of `root_sixd`: those that Python draws with the same seed, before feet are held. */
  async generate(text: string, settings: GenerateSettings = {}): Promise<Float32Array[][]> {
    const seed = this.setting("seed", settings.seed ?? 0);
    const count = this.setting("hypotheses", settings.hypotheses ?? 1);
    const noise = Array.from({ length: count }, (_, at) => (at ? new Pcg64(seed, at - 1) : new Pcg64(seed)));
    return this.drawn(text, noise, settings);
  }

  /** The same by noise that is given for each motion. */
  async drawn(text: string, noise: Noise[], given: GenerateSettings): Promise<Float32Array[][]> {
    const drawing: Drawing = {
      temperature: this.setting("temperature", given.temperature),
      first_temperature: this.setting("first_temperature", given.first_temperature),
      top_p: this.setting("top_p", given.top_p),
      guidance: this.setting("guidance", given.guidance),
      memory: this.setting("memory", given.memory),
      certainty: this.setting("certainty", given.certainty),
    };
    const seconds = given.seconds === undefined ? 0 : this.setting("seconds", given.seconds);
    const { shape } = this.graphs.decoder!.spec.outputs.find((output) => output.name === "frames")!;
    const steps = Math.ceil(((seconds || this.setting("max_seconds", given.max_seconds)) * this.fps) / Number(shape[2]) - 1e-9);
    const { context } = await this.graphs.encoder!.run(this.words(text));
    const actions = noise.map((one) => drawnAction(this.source, context!.data, one, drawing.certainty));
    const codes = await drawCodes(this.source, actions, noise, drawing, Math.max(1, steps), seconds > 0);
    const motions: Float32Array[][] = [];
    for (const one of codes) {
      const frames = await framesOf(this.graphs.decoder!, one, this.fps);
      motions.push(seconds ? frames.slice(0, Math.max(1, Math.round(seconds * this.fps))) : frames);
    }
    return motions;
  }
}

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

/** The frames of a gap. */
export class FillModel extends Model {
  constructor(manifest: Manifest, private readonly graphs: Record<string, Graph>) {
    super(manifest);
  }

  /** The frames between those before a gap (P, E) and those after it (A, E), all placed (docs/bundle.md, Fill). */
  async fill(past: Frames, after: Frames, count: number): Promise<Float64Array[]> {
    const width = Number(this.graphs.filler!.spec.inputs[0]!.shape[2]);
    const [least, context] = [this.setting("least"), this.setting("context")];
    if (!(count >= 1 && count <= this.setting("longest"))) {
      throw new DecodingError(`a gap has 1 to ${this.setting("longest")} frames, not ${count}`);
    }
    const [before, behind] = [this.checked(past, width, least).slice(-context), this.checked(after, width, least).slice(0, context)];
    return between(this.graphs.filler!, before, behind, count);
  }
}

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

export type AnyModel = DescribeModel | GenerateModel | PredictModel | FillModel | SearchModel;

/** Load a bundle from an address or its bytes; BundleError where it is damaged or of a kind that is not run here. */
export async function load(source: string | URL | Uint8Array, settings?: SessionSettings): Promise<AnyModel> {
  const bundle = await Bundle.open(source instanceof Uint8Array ? source : await fetched(source));
  const { manifest } = bundle;
  const graphs: Record<string, Graph> = {};
  for (const role of Object.keys(manifest.graphs)) graphs[role] = await bundle.graph(role, settings);
  switch (manifest.loop) {
    case "beam":
      return new DescribeModel(manifest, graphs);
    case "codes":
      return new GenerateModel(manifest, graphs, await sourceOf(bundle, graphs));
    case "free_run":
      return new PredictModel(manifest, graphs);
    case "between":
      return new FillModel(manifest, graphs);
    case "nearest":
      return new SearchModel(manifest, graphs);
    default:
      throw new BundleError(`the bundle ${manifest.name} has the loop ${JSON.stringify(manifest.loop)}, which is not run here`);
  }
}

async function fetched(address: string | URL): Promise<Uint8Array> {
  const response = await fetch(address);
  if (!response.ok) throw new BundleError(`${address}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}

async function sourceOf(bundle: Bundle, { step, part }: Record<string, Graph>): Promise<Source> {
  const tables = await Promise.all(["memory", "moves", "body"].map((name) => bundle.table(name)));
  const [memory, moves, body] = tables as [typeof tables[0], typeof tables[0], typeof tables[0]];
  const actions = bundle.manifest.actions?.length ?? 0;
  const parts = Number(part!.spec.inputs.find((input) => input.name === "codes")!.shape[1]);
  return { step: step!, part: part!, end: moves.shape[0]!, nullAction: actions, parts, memory: new Memory(memory, moves, body, actions) };
}
