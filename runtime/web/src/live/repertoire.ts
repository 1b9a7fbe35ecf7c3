/* The acts that a page knows: motet/live/repertoire.py. */
import { type Act, actOf } from "../steering/acts.js";
import type { ControlModel } from "../steering/model.js";
import { type Packed, unpacked } from "./packing.js";
import { Phrases, wordsOf } from "./words.js";

/** An act, and words that are said of it. arms: a figure can do it while it goes. */
interface Entry {
  sentence: string;
  words: string[];
  arms: boolean;
  frames: number;
}

/** steps: of a number of a frame in its unit; rows are differences from the row before. */
export interface GivenActs extends Packed {
  acts: Entry[];
  steps: number;
}

export class Repertoire {
  private readonly phrases: Phrases;
  private readonly acts = new Map<number, Act>();

  private constructor(
    private readonly model: ControlModel,
    readonly entries: readonly Entry[],
    /** Frame after frame of all acts. */
    private readonly numbers: Float64Array,
  ) {
    this.phrases = new Phrases(entries);
  }

  static async of(embedded: GivenActs, model: ControlModel): Promise<Repertoire> {
    const { frames } = await unpacked(embedded);
    const [, width] = embedded.tables.frames!.shape;
    const numbers = Float64Array.from(frames!);
    for (let at = width; at < numbers.length; at++) numbers[at]! += numbers[at - width]!;
    return new Repertoire(
      model,
      embedded.acts,
      numbers.map((value) => value / embedded.steps),
    );
  }

  /** The act that a sentence asks for, whether the arms do it alone, the words that it leaves out, and how much it has, from 0 to 1; null for a sentence that none is. */
  find(text: string): { act: Act; arms: boolean; lacking: string[]; confidence: number } | null {
    const { at, ...shown } = this.phrases.find(text);
    return at < 0 ? null : { act: this.act(at), arms: this.entries[at]!.arms, ...shown };
  }

  /** What to type for each: its sentence without who does it. */
  get names(): string[] {
    return this.entries.map(({ sentence }) => wordsOf(sentence).slice(2).join(" "));
  }

  private act(at: number): Act {
    const known = this.acts.get(at);
    if (known) return known;
    const width = this.numbers.length / this.entries.reduce((sum, { frames }) => sum + frames, 0);
    const start = this.entries.slice(0, at).reduce((sum, { frames }) => sum + frames, 0);
    const { sentence, frames } = this.entries[at]!;
    const act = actOf(this.model, sentence, this.numbers.subarray(start * width, (start + frames) * width));
    this.acts.set(at, act);
    return act;
  }
}
