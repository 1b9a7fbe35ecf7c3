import { VOCABULARY } from "../generated.js";
import type { TextTables } from "../bundle/bundle.js";
import { stem } from "./clauses.js";
import { BundleError, TextError } from "../errors.js";
import { corrected } from "./spelling.js";

const PAD = 0;
const SOS = 1;
const EOS = 2;
const UNK = 3;

/** From a sentence to the words that a model knows, and back: docs/reference/bundle.md, "Text". */
export class Vocabulary {
  static readonly SOS = SOS;
  static readonly EOS = EOS;
  /** Words that are never chosen. */
  static readonly BANNED = [PAD, SOS, UNK];
  private readonly ids: Map<string, number>;
  private readonly stems: Map<string, string>;
  private readonly misspelt: RegExp;

  constructor(
    readonly words: string[],
    private readonly rules: TextTables,
    /** Further words, whose ids go on, each with the one of `words` that is nearest to it. */
    private readonly common: Record<string, string> = {},
  ) {
    if (`${words.slice(0, 4)}` !== "PAD,SOS,EOS,UNK" || rules.rules !== 1)
      throw new BundleError("its vocabulary is damaged");
    const every = [...words, ...Object.keys(common)];
    this.ids = new Map(every.map((word, id) => [word, id]));
    const latestFirst = every.slice(UNK + 1).reverse();
    this.stems = new Map(latestFirst.map((word) => [stem(word), word]));
    const wrong = Object.keys(rules.spelling).sort((a, b) => b.length - a.length);
    this.misspelt = new RegExp(`(?<![\\p{L}\\p{N}_])(${wrong.join("|") || "(?!)"})(?![\\p{L}\\p{N}_])`, "gu");
  }

  /** The ids of a sentence's words, and the words that are unknown; TextError where there is none that is known. */
  encode(sentence: string): { ids: number[]; unknown: string[] } {
    if (sentence.length > VOCABULARY.MAX_LETTERS) {
      throw new TextError(
        `the sentence has ${sentence.length} letters, but at most ${VOCABULARY.MAX_LETTERS} are allowed`,
      );
    }
    const words = this.split(sentence);
    if (!words.length) throw new TextError(`the sentence ${JSON.stringify(sentence)} has no words`);
    if (words.length > VOCABULARY.MAX_WORDS) {
      throw new TextError(
        `the sentence has ${words.length} words, but at most ${VOCABULARY.MAX_WORDS} are allowed`,
      );
    }
    const unknown = words.filter((word) => !this.meant(word));
    if (unknown.length === words.length)
      throw new TextError(`the model knows no word of ${JSON.stringify(sentence)}`);
    return { ids: words.map((word) => this.ids.get(this.meant(word)) ?? UNK), unknown };
  }

  /** The known word that a word is, or the first of its stem, or of which it is a misspelling; "" where there is none. */
  meant(word: string): string {
    if (this.ids.has(word) || [...word].length < 4) return this.ids.has(word) ? word : "";
    const common = Object.keys(this.common); // without them "torches" were read as "touches"
    return (
      this.stems.get(stem(word)) ?? (common.length ? corrected(word, this.words.slice(UNK + 1), common) : "")
    );
  }

  /** The one of `words` that a word is, or that is nearest to it; "" where there is none. */
  near(word: string): string {
    const known = this.meant(word);
    return Object.hasOwn(this.common, known) ? this.common[known]! : known;
  }

  /** The words of a sentence, known or not; each digit is one of its own. */
  split(sentence: string): string[] {
    return this.normalise(sentence).match(/\d|\p{L}+/gu) ?? [];
  }

  /** The sentence of ids, without PAD, SOS, EOS and UNK. */
  decode(ids: Iterable<number>): string {
    const { numbers, spelled, point } = this.rules;
    const small = new Map(
      Object.entries(numbers)
        .filter(([, value]) => value <= spelled)
        .map(([word, value]) => [`${value}`, word]),
    );
    return Array.from(ids, (id) => (id > UNK ? this.words[id]! : ""))
      .join(" ")
      .replace(/(?<=\d) (?=\d)/g, "")
      .replaceAll(new RegExp(`(?<=\\d) ${point} (?=\\d)`, "g"), ".")
      .split(" ")
      .filter(Boolean)
      .map((word) => small.get(word) ?? word)
      .join(" ");
  }

  private normalise(sentence: string): string {
    const kept = [...sentence].filter((letter) => !this.rules.dropped.includes(letter)).join("");
    const plain = kept
      .normalize("NFKD")
      .toLowerCase()
      .replace(/\p{M}/gu, "")
      .replace(/(?<=\d)\.(?=\d)/g, ` ${this.rules.point} `)
      .replace(/[^\p{L}\p{N}]+/gu, " ")
      .trim();
    const spelt = plain.replace(this.misspelt, (wrong) => this.rules.spelling[wrong]!);
    return this.withDigits(spelt.split(" ")).join(" ");
  }

  private withDigits(words: string[]): string[] {
    const split: string[] = [];
    for (let at = 0; at < words.length;) {
      const [value, used] = this.number(words.slice(at, at + 5));
      split.push(used ? `${value}` : words[at]!);
      at += used || 1;
    }
    return split;
  }

  /** The number that words begin with, and how many of them it takes: 0 for none. */
  private number(words: string[]): [number, number] {
    let [value, used] = this.belowHundred(words);
    if (words[used] !== this.rules.hundred) return [value, used];
    value = 100 * (used ? value : 1);
    used = used + 1;
    const skipped = words[used] === this.rules.conjunction ? 1 : 0;
    const [more, length] = this.belowHundred(words.slice(used + skipped));
    return length ? [value + more, used + skipped + length] : [value, used];
  }

  private belowHundred(words: string[]): [number, number] {
    const [first, second] = words.map((word) =>
      Object.hasOwn(this.rules.numbers, word) ? this.rules.numbers[word] : undefined,
    );
    if (first === undefined) return [0, 0];
    return first >= 20 && second !== undefined && second > 0 && second < 10
      ? [first + second, 2]
      : [first, 1];
  }
}
