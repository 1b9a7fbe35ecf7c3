/* What a typed sentence asks for: an order such as "run" or "turn left", or one of the acts that a page knows. */
import { FUNCTION_WORDS, stem } from "../text/clauses.js";
import { corrected } from "../text/spelling.js";
import { type Net, usual } from "./crowd.js";
import type { Figure } from "./figure.js";
import { Order } from "./pilots.js";

/** Words that add nothing to an order or an act. */
const IDLE = new Set([
  ...FUNCTION_WORDS,
  ..."ahead can degrees do does doing figure forward going keep let now please some something spot start starts straight you your".split(
    " ",
  ),
]);
const TURNS: Record<string, number> = { left: 90, right: -90, around: 180, back: 180, backwards: 180 };
const STOPS = new Set(["stop", "stand", "halt", "wait", "stay", "freeze", "still"].map(stem));
const PACES: Record<string, number> = { faster: 1.4, quicker: 1.4, slower: 0.7 };
const ALL = new Set(["all", "everybody", "everyone"]);
const RADIANS = Math.PI / 180;
/** Of what a sentence says an act has to have so much, by how rare the words are. */
const ENOUGH = 0.6;

/** The words of a sentence in lower case, and numbers. */
export function wordsOf(text: string): string[] {
  return text.toLowerCase().match(/\d+|\p{L}+/gu) ?? [];
}

/** Whether a sentence is said to all figures. */
export function saysAll(text: string): boolean {
  return wordsOf(text).some((word) => ALL.has(word));
}

/** The order that a sentence is: a gait, a way, a pace or to stop, from what a figure does now; null for any other sentence. */
export function orderOf(text: string, net: Net, { wanted, root }: Figure): Order | null {
  const words = wordsOf(text).filter((word) => !IDLE.has(word) && !ALL.has(word));
  const order = new Order(wanted.gait, Math.hypot(wanted.x, wanted.z), root[2]);
  const gaits = net.gaits.map((name) => (net.speeds[name]![1]! > 0 ? stem(name) : "")); // a jump on the spot is an act
  const side = words.find((word) => word in TURNS);
  for (const word of words) {
    const gait = gaits.indexOf(stem(word));
    if (gait >= 0) Object.assign(order, { gait, speed: usual(net, gait) });
    else if (STOPS.has(stem(word))) Object.assign(order, { gait: 0, speed: 0 });
    else if (word in PACES) order.speed *= PACES[word]!;
    else if (!(word in TURNS || stem(word) === "turn" || (side && /^\d+$/.test(word)))) return null;
  }
  if (!words.length || (!side && words.every((word) => stem(word) === "turn"))) return null;
  const degrees = Number(words.find((word) => /^\d+$/.test(word)) ?? 0);
  if (side) order.way += RADIANS * (degrees ? Math.sign(TURNS[side]!) * degrees : TURNS[side]!);
  return order;
}

/** The gait that goes nowhere whose name is all that a sentence says: it is done once. */
export function onceOf(text: string, net: Net): string | undefined {
  const words = wordsOf(text)
    .filter((word) => !IDLE.has(word) && !ALL.has(word))
    .map(stem);
  return words.length === 1
    ? net.gaits.find((name) => !net.speeds[name]![1] && stem(name) === words[0])
    : undefined;
}

/** Finds what a sentence asks for among sentences with further words that are said of the same. */
export class Phrases {
  private readonly stems: Set<string>[];
  private readonly known: string[];

  constructor(private readonly phrases: readonly { sentence: string; words: readonly string[] }[]) {
    this.stems = phrases.map(
      ({ sentence, words }) =>
        new Set([...wordsOf(sentence), ...words].filter((word) => !IDLE.has(word)).map(stem)),
    );
    this.known = [...new Set(phrases.flatMap(({ sentence, words }) => [...wordsOf(sentence), ...words]))];
  }

  /** The number of the phrase, -1 if none has enough of what is said; the words that it leaves out; how much it has, by their weight. */
  find(text: string): { at: number; lacking: string[]; confidence: number } {
    const words = wordsOf(text).filter((word) => !IDLE.has(word) && !ALL.has(word));
    const wanted = words.map((word) => this.read(word));
    const all = wanted.reduce((sum, word) => sum + this.weight(word), 0);
    const scores = this.stems.map((stems, at) => {
      const shared = wanted.reduce((sum, word) => sum + (stems.has(word) ? this.weight(word) : 0), 0);
      return { at, share: all ? shared / all : 0, ...this.overlap(at, wanted) };
    });
    const [best] = scores.sort(
      (a, b) => b.share - a.share || b.shared - a.shared || a.rest - b.rest || a.at - b.at,
    );
    if (!best || best.share < ENOUGH) return { at: -1, lacking: words, confidence: best?.share ?? 0 };
    return {
      at: best.at,
      lacking: words.filter((_, i) => !this.stems[best.at]!.has(wanted[i]!)),
      confidence: best.share,
    };
  }

  /** The stem of a word, or of the known one that it is a misspelling of. */
  private read(word: string): string {
    const stemmed = stem(word);
    if (this.stems.some((stems) => stems.has(stemmed))) return stemmed;
    return stem(corrected(word, this.known) || word);
  }

  /** How rare a stem is: greatest where no phrase has it. */
  private weight(word: string): number {
    return (
      Math.log((this.stems.length + 1) / (this.stems.filter((stems) => stems.has(word)).length + 1)) + 0.1
    );
  }

  /** How many words of its own sentence are asked for, and how many are not. */
  private overlap(at: number, wanted: string[]): { shared: number; rest: number } {
    const words = wordsOf(this.phrases[at]!.sentence).filter((word) => !IDLE.has(word));
    const shared = words.filter((word) => wanted.includes(stem(word))).length;
    return { shared, rest: words.length - shared };
  }
}
