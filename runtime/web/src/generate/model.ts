import {
  GENERATE,
  READING,
  continuationSettings,
  familiaritySettings,
  memorySettings,
} from "../generated.js";
import type { Bundle, Manifest } from "../bundle/bundle.js";
import { type Codec, codesOf, type Context, StreamingDecoder } from "./codec.js";
import { ADDRESSEE, FUNCTION_WORDS, partsOf, sentencesOf, stem, SUBJECT, verbsOf } from "../text/clauses.js";
import { Commands } from "./commands.js";
import { drawCodes, drawnAction, drawnSteps, DRAWING, type Drawing, type Source, Writer } from "./codes.js";
import { BundleError, DecodingError, TextError } from "../errors.js";
import type { Graph } from "../bundle/graph.js";
import { Memory } from "./memory.js";
import { type Frames, LanguageModel } from "../models/base.js";
import { type Noise, Pcg64, stateOf } from "../decode/random.js";
import { counted, ranked, sumOf } from "../motion/numbers.js";
import { settingsOf } from "../settings.js";

/** How motions are drawn: by default as the bundle says. */
export interface GenerateSettings extends Partial<Drawing> {
  /** Of the random numbers, 0 by default: a seed gives the motion that it gives in Python. */
  seed?: number;
  /** How many motions, 1 by default. */
  hypotheses?: number;
  /** The exact length; by default a motion ends by itself. */
  seconds?: number;
  /** The most seconds of a motion that ends by itself. */
  max_seconds?: number;
  /** Take a text that asks for several things in a row as one; else it is a story of its parts. */
  whole?: boolean;
  /** Refuse a text that is outside the training data, or of which a word is unknown or left out. */
  strict?: boolean;
}

/** How a story is drawn: by default as the bundle says. */
export interface StorySettings extends Partial<Drawing> {
  seed?: number;
  /** Of each sentence, or one value for all; null for a sentence that ends by itself, as all do by default. */
  seconds?: number | (number | null)[];
  max_seconds?: number;
  /** Take a text that asks for several things in a row as one; else its parts are passages, each of the same length. */
  whole?: boolean;
  /** Refuse texts like `GenerateSettings.strict`. */
  strict?: boolean;
  /** Where the figure is to stand briefly. */
  stand?: "start" | "end" | "both";
  /** The frames (T, D) that the story continues, such as those of an earlier one. */
  after?: Frames;
}

/** What a text is shown as. */
export interface Shown {
  /** A sentence of the known action that is shown; "" where there are several. */
  action: string;
  /** Known words of the text that no sentence of that action has; the console is warned of them. */
  lacking: string[];
  /** From 0 to 1, how well the model knows the text: see `understood`; of several sentences the one that it knows least. */
  confidence: number;
}

/** A motion that was drawn: frames (T, D) of `root_sixd`, those that Python draws with the same seed, before feet are held. */
export interface Generated extends Shown {
  frames: Float32Array[];
}

/** A motion of several sentences. */
export interface Story extends Generated {
  passages: Passage[];
}

/** A sentence of a story, shown from `start` to `stop` in seconds. */
export interface Passage extends Shown {
  text: string;
  start: number;
  stop: number;
}

/** How well a sentence is known, from 0 to 1, whether that is enough, and sentences of the likeliest actions. */
export interface Understood {
  confidence: number;
  confident: boolean;
  nearest: string[];
}

/** Sentences of a story, for each its seconds (0 where it ends by itself), whether they are whole, how it is drawn. */
interface Script {
  whole: boolean;
  strict: boolean;
  texts: string[];
  seconds: number[];
  longest: number;
  drawing: Drawing;
  noise: Noise;
}

/** Frames of a story that become final, with which sentence, and so many steps of it. */
interface Piece {
  sentence: number;
  /** Of the first piece of a sentence. */
  shown?: Shown;
  frames: Float32Array[];
  steps: number;
}

/** What is said of a sentence whose action lacks words of it. */
function leftOut(sentence: string, { action, lacking }: Shown): string {
  return `'${sentence}' is read as '${action}', which leaves out ${lacking.map((word) => `'${word}'`).join(", ")}`;
}

/** The stem of the word after the subject of a clause. */
function firstVerb(clause: string): string {
  return stem(clause.replace(SUBJECT, "").toLowerCase().trim().split(/\s+/)[0]!);
}

/** Motions for a sentence, drawn as codes. */
export class GenerateModel extends LanguageModel {
  private readonly familiarity = this.tuned("familiarity", familiaritySettings);
  private readonly continuation = this.tuned("continuation", continuationSettings);
  private readonly verbs: ReturnType<typeof verbsOf>;
  private readonly commands: Commands;

  constructor(
    manifest: Manifest,
    private readonly encoder: Graph,
    private readonly source: Source,
    private readonly codec: Codec,
  ) {
    super(manifest);
    const split = (text: string) => this.vocabulary.split(text);
    const meant = (word: string) => this.vocabulary.meant(word);
    this.commands = new Commands(manifest.commands ?? [], split, meant, manifest.actions?.length ?? 0);
    const verbs = verbsOf((manifest.actions ?? []).flatMap(({ words }) => words));
    this.verbs = new Set([...verbs, ...this.commands.verbs]);
  }

  /** Motions for a text; of one that asks for several things in a row each is a `Story`. */
  async generate(text: string, settings: GenerateSettings = {}): Promise<(Generated | Story)[]> {
    const seed = this.setting("seed", settings.seed ?? 0);
    const count = this.setting("hypotheses", settings.hypotheses ?? 1);
    if (!settings.whole && (await this.parts(text)).length > 1) {
      const motions: Story[] = [];
      for (const value of [seed, ...stateOf(seed, count - 1)])
        motions.push(await this.story(text, { ...settings, seed: value }));
      return motions;
    }
    const noise = Array.from({ length: count }, (_, at) => (at ? new Pcg64(seed, at - 1) : new Pcg64(seed)));
    return this.drawn(text, noise, settings);
  }

  /** What a text asks for one after another: docs/reference/bundle.md, "Several things in one text". */
  async parts(request: string): Promise<string[]> {
    const text = request.replace(ADDRESSEE, "");
    this.words(text);
    const pieces: string[] = [];
    for (const sentence of sentencesOf(text)) {
      const parts = partsOf(sentence, this.verbs);
      const atOnce = parts.length > 1 && !(await this.splits(sentence, parts));
      pieces.push(...(atOnce ? [sentence] : parts));
    }
    if (pieces.length < 2) return [text];
    const parts = await Promise.all(pieces.map((piece) => this.parts(piece)));
    return parts.flat();
  }

  /** Whether parts are shown one by one: the likeliest action lacks some, or all are commands and not one together. */
  private async splits(sentence: string, parts: string[]): Promise<boolean> {
    if (await this.lacks(sentence)) return true;
    if (this.commands.act(sentence) !== undefined) return false;
    return parts.every((part) => this.commands.act(part) !== undefined);
  }

  /** Whether the likeliest action lacks something of a sentence. */
  private async lacks(sentence: string): Promise<boolean> {
    const context = await this.context(sentence);
    return this.lacking(sentence, context.indexOf(Math.max(...context))).length > 0;
  }

  /** The known words of a sentence, but for function words, of which no sentence of an action has any form. */
  private lacking(sentence: string, action: number): string[] {
    const have = this.has(sentence, action);
    const words = new Set(this.vocabulary.split(sentence).map((word) => this.vocabulary.meant(word)));
    const lacks = (word: string) =>
      word &&
      !FUNCTION_WORDS.has(word) &&
      ![word, this.vocabulary.near(word)].some((form) => have.has(stem(form)));
    return [...words].filter(lacks).sort();
  }

  /** The stems that show the words of a sentence in an action. */
  private has(sentence: string, action: number): Set<string> {
    const { first } = this.commands;
    if (action < first - 1) return new Set(this.manifest.actions![action]!.words.map(stem));
    return action < first || this.commands.isInstead(sentence) ? new Set() : this.commands.stems(action);
  }

  /** The sentence of an action or of a command; "" of no action. */
  private named(action: number): string {
    const { acts, first } = this.commands;
    return action < first - 1
      ? this.manifest.actions![action]!.sentence
      : (acts[action - first]?.sentence ?? "");
  }

  /** What a sentence is taken for. */
  private shown(sentence: string, action: number, context: Float32Array): Shown {
    const shown = this.shownAs(sentence, action, context);
    if (shown.lacking.length) console.warn(leftOut(sentence, shown));
    return shown;
  }

  private shownAs(sentence: string, action: number, context: Float32Array): Shown {
    return {
      action: this.named(action),
      lacking: this.lacking(sentence, action),
      confidence: this.known(sentence, context).confidence,
    };
  }

  /** The context of a sentence; strict: without the actions that leave out a word. TextError for what is refused then. */
  private async contextOf(sentence: string, strict = false): Promise<Float32Array> {
    const context = await this.context(sentence);
    if (!strict) return context;
    const { unknown } = this.vocabulary.encode(sentence);
    if (unknown.length)
      throw new TextError(`the model does not know ${unknown.join(", ")} (in '${sentence}')`);
    const { confidence, confident, nearest } = this.known(sentence, context);
    const near = nearest.map((example) => `'${example}'`).join(", ");
    if (!confident)
      throw new TextError(
        `'${sentence}' is outside the training data (confidence ${confidence.toFixed(2)}); nearest: ${near}`,
      );
    const shown = this.shownAs(sentence, context.indexOf(Math.max(...context)), context);
    if (shown.lacking.length) throw new TextError(leftOut(sentence, shown));
    return context.map((value, action) => (this.lacking(sentence, action).length ? READING.NEVER : value));
  }

  /** The same by noise that is given for each motion. */
  async drawn(text: string, noise: Noise[], settings: GenerateSettings): Promise<Generated[]> {
    const drawing = this.drawing(settings);
    const seconds = settings.seconds === undefined ? 0 : this.setting("seconds", settings.seconds);
    const longest = Math.max(1, this.steps(seconds || this.setting("max_seconds", settings.max_seconds)));
    const context = await this.contextOf(text, settings.strict);
    const actions = noise.map((source) => drawnAction(this.source, context, source, drawing.certainty));
    const codes = await drawCodes(new Writer(this.source, noise, drawing), actions, longest, seconds > 0);
    const shown = new Map([...new Set(actions)].map((action) => [action, this.shown(text, action, context)]));
    const motions: Generated[] = [];
    for (const [at, motion] of codes.entries()) {
      const frames = await new StreamingDecoder(this.codec).push(motion, true);
      const last = seconds ? Math.max(1, Math.round(seconds * this.fps)) : frames.length;
      motions.push({ frames: frames.slice(0, last), ...shown.get(actions[at]!)! });
    }
    return motions;
  }

  /** One motion for several sentences, each from where the last one ends, and when each is shown. */
  async story(sentences: string | string[], settings: StorySettings = {}): Promise<Story> {
    const script = await this.parted(this.scriptOf(sentences, settings));
    const steps = script.texts.map(() => 0);
    const shown: Shown[] = [];
    const frames: Float32Array[] = [];
    for await (const piece of this.pieces(script, settings.after)) {
      frames.push(...piece.frames);
      if (piece.shown) shown.push(piece.shown);
      steps[piece.sentence]! += piece.steps;
    }
    let start = 0;
    let over = 0;
    const passages = script.texts.map((text, at): Passage => {
      over += steps[at]! * this.codec.hop;
      const passage = { text, start, stop: Math.min(over, frames.length) / this.fps, ...shown[at]! };
      start = passage.stop;
      return passage;
    });
    const action = passages.length > 1 ? "" : passages[0]!.action;
    const confidence = Math.min(...passages.map((passage) => passage.confidence));
    return { frames, action, lacking: passages.flatMap((passage) => passage.lacking), confidence, passages };
  }

  /** The frames of `story` in pieces, as they are drawn; what cannot be told is refused before the first one. */
  stream(sentences: string | string[], settings: StorySettings = {}): AsyncGenerator<Float32Array[], void> {
    const script = this.scriptOf(sentences, settings);
    const pieces = async () => this.pieces(await this.parted(script), settings.after);
    return (async function* () {
      for await (const { frames } of await pieces()) if (frames.length) yield frames;
    })();
  }

  /** How well a sentence is known, and the nearest known sentences: docs/reference/bundle.md, the loop `codes`. */
  async understood(text: string): Promise<Understood> {
    return this.known(text, await this.context(text));
  }

  private known(text: string, context: Float32Array): Understood {
    const actions = this.manifest.actions!;
    const counts = counted(actions.flatMap(({ words }) => [...new Set(words)]));
    const rare = (word: string) => Math.log((1 + actions.length) / counts.get(word)!);
    const unheard = Math.log(1 + actions.length);
    const textWords = [...new Set(this.vocabulary.split(text))];
    const heard = textWords.reduce((sum, word) => sum + (counts.has(word) ? rare(word) : 0), 0);
    const all = textWords.reduce((sum, word) => sum + (counts.has(word) ? rare(word) : unheard), 0);
    const order = ranked(context);
    const { confident, doubt } = this.familiarity;
    const likeliest = order[0]!;
    const isCommand = likeliest >= this.commands.first && !this.lacking(text, likeliest).length;
    const share = isCommand ? 1 : heard / (all || 1);
    const confidence = share * Math.exp(context[likeliest]!) ** doubt;
    const sentences = order.map((action) => this.named(action)).filter(Boolean);
    const nearest = [...new Set(sentences)].slice(0, 3);
    return { confidence, confident: confidence >= confident, nearest };
  }

  /** The context (A + 1 + C) of a text where the bundle has C commands, else (A). */
  private async context(text: string): Promise<Float32Array> {
    const context: Float32Array = (await this.encoder.run(this.words(text))).context!.data;
    return this.commands.acts.length ? this.meant(text, context) : context;
  }

  /** That of a command alone, or of the nearest one where it leaves out less than the likeliest action, or the same and
   * that does something else. */
  private meant(text: string, context: Float32Array): Float32Array {
    const isRecorded = this.manifest.actions!.some(({ sentence }) => sentence === text);
    const order = isRecorded ? text : text.replace(SUBJECT, "");
    const isInstead = order !== text && this.commands.isInstead(order);
    let act = isInstead ? undefined : this.commands.act(order);
    const nearest = act === undefined ? this.commands.nearest(order) : undefined;
    if (nearest !== undefined) {
      // a word more where the likeliest action is not confident, and two where it lacks a word of the command
      const likeliest = context.indexOf(Math.max(...context));
      const lacking = this.lacking(text, likeliest);
      const doubtful = this.known(text, context).confident ? 0 : 1;
      const lacksCommand = lacking.some((word) => nearest.includes(stem(word))) ? 2 : 0;
      const command = this.commands.action(nearest.join(" "));
      const lacked = this.lacking(text, command);
      const isOther = firstVerb(text) !== firstVerb(this.named(likeliest));
      const isSame = lacked.join(" ") === lacking.join(" ");
      if ((isOther && isSame) || lacked.length < lacking.length + doubtful + lacksCommand) act = command;
    }
    const meant = new Float32Array(this.commands.first + this.commands.acts.length).fill(READING.NEVER);
    meant.set(act === undefined ? context : context.map((value) => value + READING.FAR_LESS));
    if (act !== undefined) meant[act] = 0;
    return meant;
  }

  private drawing(settings: Partial<Drawing>): Drawing {
    return Object.fromEntries(DRAWING.map((name) => [name, this.setting(name, settings[name])])) as Drawing;
  }

  /** How many steps cover a time. */
  private steps(seconds: number): number {
    return Math.ceil((seconds * this.fps) / this.codec.hop - 1e-9);
  }

  private scriptOf(sentences: string | string[], settings: StorySettings): Script {
    const texts = typeof sentences === "string" ? [sentences] : [...sentences];
    const each = Array.isArray(settings.seconds)
      ? settings.seconds
      : texts.map(() => (settings.seconds as number | undefined) ?? null);
    if (!texts.length) throw new TextError("a story needs a sentence");
    if (each.length !== texts.length)
      throw new DecodingError(`${texts.length} sentences have ${each.length} lengths`);
    if (![undefined, "start", "end", "both"].includes(settings.stand))
      throw new DecodingError(`stand is start, end or both, not ${settings.stand}`);
    const seconds = each.map((length) => (length === null ? 0 : this.setting("seconds", length)));
    for (const end of ["start", "end"] as const) {
      if (settings.stand !== end && settings.stand !== "both") continue;
      texts[end === "start" ? "unshift" : "push"](GENERATE.STANDS);
      seconds[end === "start" ? "unshift" : "push"](GENERATE.STANDING_SECONDS);
    }
    texts.forEach((text) => this.words(text));
    const longest = this.steps(this.setting("max_seconds", settings.max_seconds));
    return {
      texts,
      seconds,
      whole: settings.whole ?? false,
      strict: settings.strict ?? false,
      longest,
      drawing: this.drawing(settings),
      noise: new Pcg64(this.setting("seed", settings.seed ?? 0)),
    };
  }

  /** The story with the parts of its sentences as passages. */
  private async parted(script: Script): Promise<Script> {
    const parts = script.whole
      ? script.texts.map((text) => [text])
      : await Promise.all(script.texts.map((text) => this.parts(text)));
    const texts = parts.flat();
    if (script.strict) for (const text of texts) await this.contextOf(text, true); // refused before anything is drawn
    return {
      ...script,
      texts,
      seconds: parts.flatMap((part, at) => part.map(() => script.seconds[at]! / part.length)),
    };
  }

  /** What each sentence is shown as, then for each step of codes the frames that become final with it; at last the remaining frames. */
  private async *pieces(
    { texts, strict, seconds, longest, drawing, noise }: Script,
    after?: Frames,
  ): AsyncGenerator<Piece, void> {
    const writer = new Writer(this.source, [noise], drawing);
    const before = after && (await this.continued(after));
    if (before) writer.see(before.codes);
    const decoder = new StreamingDecoder(this.codec, before);
    let done = 0;
    let shown = 0;
    let end = 0;
    let limit = Infinity;
    for (const [sentence, text] of texts.entries()) {
      const context = await this.contextOf(text, strict);
      const action = drawnAction(this.source, context, noise, drawing.certainty);
      yield { sentence, shown: this.shown(text, action, context), frames: [], steps: 0 };
      const length = seconds[sentence]!;
      end += length;
      limit = length ? Math.max(1, Math.round(end * this.fps)) : Infinity;
      const most = length ? this.steps(end) - done : longest;
      for await (const { codes } of drawnSteps(writer, [action], most, length > 0)) {
        done++;
        const frames = (await decoder.push(codes)).slice(0, limit - shown);
        shown += frames.length;
        yield { sentence, frames, steps: 1 };
      }
      if (!length) end = (done * this.codec.hop) / this.fps;
    }
    yield {
      sentence: texts.length - 1,
      frames: (await decoder.push([], true)).slice(0, limit - shown),
      steps: 0,
    };
  }

  /** The last seconds, whole steps of codes, of a motion. */
  private async continued(after: Frames): Promise<Context> {
    const { hop } = this.codec;
    const frames = this.checked(after, this.manifest.motion.channels.length, 2 * hop).slice(
      -this.steps(this.continuation.context) * hop,
    );
    const whole = frames.slice(frames.length % hop);
    return { frames: whole, codes: await codesOf(this.codec, whole) };
  }
}

/** What a bundle of the loop `codes` makes. */
export async function generateModel(bundle: Bundle, graphs: Record<string, Graph>): Promise<GenerateModel> {
  const { manifest } = bundle;
  const [memory, moves, body] = await Promise.all([
    bundle.table("memory"),
    bundle.table("moves"),
    bundle.table("body"),
  ]);
  const { step, part, encoder, decoder, tokens } = graphs as Record<string, Graph>;
  const { ahead, hop } = (manifest.config.codec ?? {}) as { ahead: number[]; hop: number };
  const shape = decoder!.spec.outputs.find((output) => output.name === "frames")!.shape;
  const looks =
    Array.isArray(ahead) && ahead.length <= 8 && ahead.every((steps) => [0, 1, 2].includes(steps));
  if (!looks || hop !== shape[2])
    throw new BundleError(`the bundle ${manifest.name} does not say what its decoder looks at`);
  const actions = manifest.actions?.length ?? 0;
  const end = moves.shape[0]!;
  const parts = Number(part!.spec.inputs.find((input) => input.name === "codes")!.shape[1]);
  const commands = manifest.commands ?? [];
  const known = commands.length ? actions + 1 + commands.length : actions;
  const lent = new Map(commands.map(({ action }, at) => [actions + 1 + at, action]));
  const remembers = settingsOf("memory", memorySettings, manifest.settings.memory);
  const source: Source = {
    step: step!,
    part: part!,
    end,
    nullAction: actions,
    parts,
    memory: new Memory(memory, moves, body, known, remembers, lent),
    written: [...Array(actions + 1).keys(), ...commands.map(({ action }) => action)],
  };
  const codec: Codec = {
    decoder: decoder!,
    tokens: tokens!,
    moves: end,
    back: ahead.reduce((sum, steps) => sum + 2 - steps, 0) + Math.ceil(4 / hop),
    ahead: sumOf(ahead),
    hop,
    fps: manifest.motion.fps,
    halfLife: settingsOf("continuation", continuationSettings, manifest.settings.continuation).half_life,
  };
  return new GenerateModel(manifest, encoder!, source, codec);
}
