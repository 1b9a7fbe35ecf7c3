/* What a typed sentence asks a figure for: motet/steering/spoken.py, which says what each part is. */
import { SPOKEN, STYLES } from "../generated.js";
import { clamp } from "../motion/springs.js";
import { stem } from "../text/clauses.js";
import { corrected } from "../text/spelling.js";
import type { Entry } from "./repertoire.js";

const LISTS = [
  "idle",
  "everyone",
  "plural",
  "stop",
  "never",
  "slow",
  "fast",
  "loud",
  "then",
  "both",
  "times",
  "where",
  "articles",
  "compared",
] as const;

/** The words of the file of the repertoire. */
export type WordTable = Record<(typeof LISTS)[number] | "still", string[]> & {
  counts: Record<string, number>;
  sides: Record<string, string[]>;
  orders: Record<string, string[]>;
  phrases: Record<string, string[]>;
  styles: Record<string, string[]>;
};

/** A part of what is said. Angles are degrees to the left. */
export interface Step {
  kind: "act" | "go" | "stop" | "here" | "away";
  name: string;
  side: string;
  tempo: number;
  count: number;
  style: string;
  pace: number;
  change: number;
  way: number;
  aside: boolean;
  curve: number;
  seconds: number;
  together: boolean;
  lacking: string;
}

const PLAIN: Omit<Step, "kind"> = {
  name: "",
  side: "",
  tempo: 1,
  count: 1,
  style: "",
  pace: 0,
  change: 1,
  way: 0,
  aside: false,
  curve: 0,
  seconds: 0,
  together: false,
  lacking: "",
};

const stepOf = (kind: Step["kind"], parts: Partial<Step> = {}): Step => ({ ...PLAIN, kind, ...parts });

/** What phrases mean that are not read word by word. */
const ORDERS: Record<string, Step> = {
  here: stepOf("here"),
  away: stepOf("away"),
  around: stepOf("go", { way: 180 }),
  faster: stepOf("go", { change: SPOKEN.FAST_FACTOR }),
  slower: stepOf("go", { change: SPOKEN.SLOW_FACTOR }),
};

/** What a sentence is read as; without steps, the part that is not known, and the nearest names. */
export interface Reading {
  steps: Step[];
  unknown: string;
  nearest: string[];
  everyone: boolean;
  mended: Record<string, string>;
}

/** What is answered to a sentence. */
export function captionOf({ steps, unknown, nearest, mended }: Reading): string {
  if (!steps.length) {
    const what = unknown ? `'${unknown}' is not known` : "Nothing is said";
    return `? ${what}. Nearest: ${nearest.join(", ")}.`;
  }
  let text = "";
  for (const step of steps) {
    if (text) text += step.together ? " and " : ", then ";
    text += stepCaption(step);
  }
  const words = Object.entries(mended).map(([word, readAs]) => `'${word}' read as '${readAs}'`);
  return words.length ? `${text}: ${words.join(", ")}` : text;
}

function stepCaption(step: Step): string {
  const { kind, name, side, tempo, count, lacking } = step;
  if (kind === "act") {
    const details = side ? [side] : [];
    if (tempo !== 1) details.push(tempo < 1 ? "slowly" : "fast");
    if (count !== 1) details.push(count === 2 ? "twice" : `${count} times`);
    if (lacking) details.push(`without '${lacking}'`);
    return details.length ? `${name} (${details.join(", ")})` : name;
  }
  if (kind === "go") return wayCaption(step);
  return { stop: "stop", here: "come here", away: "go away" }[kind];
}

function wayCaption({ name, style, pace, change, way, aside, curve, lacking }: Step): string {
  const words = name ? [name] : [];
  if (pace !== 0 && pace !== 1) words.push(pace < SPOKEN.JOG ? "slowly" : pace > 1 ? "fast" : "at a jog");
  if (change !== 1) words.push(change > 1 ? "faster" : "slower");
  if (curve) words.push("in a circle");
  if (aside) words.push(way === 180 ? "backwards" : way === 90 ? "sideways left" : "sideways right");
  else if (way) {
    const degrees = Math.abs(way);
    words.push(degrees === 180 ? "turn around" : `turn ${way > 0 ? "left" : "right"}`);
    if (degrees !== 90 && degrees !== 180) words.push(`${degrees} degrees`);
  }
  if (style) words.push(`(${style})`);
  if (lacking) words.push(`(without '${lacking}')`);
  return words.join(" ");
}

/** A phrase for a style: what its words share but for a gait, and whether it names one. */
interface StylePhrase {
  roots: string[];
  namesGait: boolean;
  style: string;
}

export class Words {
  readonly acts: Map<string, Entry>;
  private readonly idle: Set<string>;
  private readonly byKey = new Map<string, string>();
  private readonly orders = new Map<string, string>();
  private readonly still: Set<string>;
  private readonly kinds = new Map<string, string>();
  private readonly styleKeys = new Map<string, string>();
  private readonly styles: StylePhrase[];
  private readonly limbs: Set<string>;
  private readonly manner: Set<string>;
  private readonly known: string[];
  private readonly stems: Set<string>;

  /** Of the repertoire's words and acts, for a figure with gaits that lead somewhere. */
  constructor(
    private readonly table: WordTable,
    acts: Iterable<[string, Entry]>,
    private readonly gaits: readonly string[],
  ) {
    this.acts = new Map(acts);
    this.idle = new Set(table.idle);
    for (const { name, phrases } of this.acts.values()) {
      for (const phrase of phrases) this.byKey.set(this.key(phrase), name);
    }
    for (const [order, phrases] of Object.entries(table.phrases)) {
      for (const phrase of phrases) this.orders.set(this.key(phrase), order);
    }
    this.still = new Set(table.still.map((phrase) => this.key(phrase)));
    for (const [kind, words] of Object.entries(table.orders)) {
      for (const word of words) this.kinds.set(stem(word), kind);
    }
    for (const gait of gaits) this.kinds.set(stem(gait), gait);
    this.styles = this.stylePhrases();
    this.limbs = new Set([...this.acts.values()].flatMap(({ limbs }) => [...limbs]));
    const { slow, fast, loud, times, counts } = table;
    this.manner = new Set([...slow, ...fast, ...loud, ...times, ...Object.keys(counts)]);
    this.known = [...new Set(this.allWords())];
    this.stems = new Set(this.known.map(stem));
  }

  private *allWords(): Generator<string> {
    const { table } = this;
    for (const name of LISTS) yield* table[name];
    yield* Object.keys(table.counts);
    for (const group of [table.sides, table.orders]) {
      for (const [name, words] of Object.entries(group)) {
        yield name;
        yield* words;
      }
    }
    yield* this.gaits;
    const phrases = [...this.acts.values()].flatMap((act) => act.phrases);
    const orders = Object.values(table.phrases).flat();
    const styles = Object.values(table.styles).flat();
    for (const phrase of [...phrases, ...table.still, ...orders, ...styles]) yield* wordsOf(phrase);
  }

  /** The phrases for styles, the longest first, without those that mean no more than a pace. */
  private stylePhrases(): StylePhrase[] {
    const { slow, fast } = this.table;
    const passed = new Set([...this.kinds.keys(), ...[...slow, ...fast].map(stem)]);
    for (const [style, texts] of Object.entries(this.table.styles)) {
      for (const text of texts) this.styleKeys.set(this.key(text), style);
    }
    const phrases: StylePhrase[] = [];
    for (const [key, style] of this.styleKeys) {
      const roots = key.split(" ");
      const others = roots.filter((root) => !this.isGait(root));
      const namesGait = others.length < roots.length;
      if (!roots.every((root) => passed.has(root))) phrases.push({ roots: others, namesGait, style });
    }
    return phrases.sort((a, b) => b.roots.length - a.roots.length);
  }

  private isGait(root: string): boolean {
    return this.gaits.includes(this.kinds.get(root) ?? "");
  }

  /** What a phrase shares with others of the same words: their stems without idle ones, sorted. */
  private key(words: string | readonly string[]): string {
    const each = typeof words === "string" ? wordsOf(words) : words;
    const roots = each.filter((word) => !this.idle.has(word)).map((word) => this.root(word));
    return [...new Set(roots)].sort().join(" ");
  }

  /** What the forms of a word share: one hand is not two hands. */
  private root(word: string): string {
    return this.table.plural.includes(word) ? word : stem(word);
  }

  /** What a sentence is read as. */
  read(text: string): Reading {
    const { table } = this;
    const all = wordsOf(text);
    const everyone = all.some((word) => table.everyone.includes(word));
    const mended: Record<string, string> = {};
    const words = all
      .filter((word) => !table.everyone.includes(word))
      .map((word) => this.mendedWord(word, mended));
    const nothing = { steps: [], unknown: "", everyone, mended: {} };
    const steps: Step[] = [];
    for (const clause of this.clauses(words)) {
      const other = this.otherSide(clause, steps);
      const part = other.length ? other : this.together(clause);
      if (typeof part === "string") return { ...nothing, unknown: part, nearest: this.nearest(part) };
      steps.push(...part);
    }
    if (!steps.length) return { ...nothing, nearest: this.nearest("") };
    return { steps, unknown: "", nearest: [], everyone, mended };
  }

  /** The parts of words that follow each other; "twice" or "slowly" after a comma belongs to the part before. */
  private clauses(words: readonly string[]): string[][] {
    const clauses: string[][] = [];
    for (const clause of split(words, [...MARKS, ...this.table.then])) {
      const meant = clause.filter((word) => !this.idle.has(word));
      if (clauses.length && meant.every((word) => this.manner.has(word))) clauses.at(-1)!.push(...clause);
      else if (meant.length) clauses.push(clause);
    }
    return clauses;
  }

  /** A word, or the known one that it is a misspelling of. */
  private mendedWord(word: string, mended: Record<string, string>): string {
    const isWord = [...word].length >= SPOKEN.SHORTEST_MENDED && /^\p{L}+$/u.test(word);
    if (!isWord || this.known.includes(word) || this.stems.has(stem(word))) return word;
    const readAs = corrected(word, this.known);
    if (readAs) mended[word] = readAs;
    return readAs || word;
  }

  /** The last of steps once more on the side that words are alone with; none for other words. */
  private otherSide(words: readonly string[], steps: readonly Step[]): Step[] {
    const meant = this.withoutSides(words).filter((word) => !this.idle.has(word) && word !== "one");
    const side = this.side(words);
    const last = steps.at(-1);
    if (!side || !last || !meant.every((word) => this.limbs.has(word))) return [];
    const isSided = last.kind === "act" && this.acts.get(last.name)!.side;
    return isSided ? [{ ...last, side, together: false }] : [];
  }

  /** The steps of words that are done at once, "A and B", but for acts, of which one follows the other; what of them is not known. */
  private together(words: readonly string[]): Step[] | string {
    let parts = split(words, this.table.both).filter((part) => part.length);
    const steps: Step[] = [];
    if (this.stopsFirst(parts)) {
      steps.push(stepOf("stop"));
      parts = parts.slice(1);
    } else {
      const whole = this.step(words);
      if (whole) return [whole];
    }
    while (parts.length) {
      const [step, count] = this.longest(parts);
      if (!step) return parts[0]!.join(" ");
      const before = steps.at(-1);
      steps.push({ ...step, together: !!before && isDoneWith(step, before) });
      parts = parts.slice(count);
    }
    return steps;
  }

  /** Whether parts begin with a stop, and go on with something else than what is stopped. */
  private stopsFirst(parts: readonly string[][]): boolean {
    const [first, second] = parts.slice(0, 2).map((part) => part.filter((word) => !this.idle.has(word)));
    if (!first?.length || !second?.length) return false;
    return this.table.stop.includes(first[0]!) && !second[0]!.endsWith("ing");
  }

  /** The step of as many parts as make sense together, as in "look left and right", or of the first without its place; and how many. */
  private longest(parts: readonly string[][]): [step: Step | null, count: number] {
    for (let count = parts.length; count > 0; count--) {
      const step = this.step(parts.slice(0, count).flat());
      if (step) return [step, count];
    }
    return [this.goneSomewhere(parts[0]!), 1];
  }

  /** The step of words; null where they are not known. */
  private step(all: readonly string[]): Step | null {
    const words = all.filter((word) => !this.idle.has(word));
    const key = this.key(words);
    const order = this.orders.get(key);
    if (order !== undefined) return ORDERS[order]!;
    // "march forward" is a style, not the act on the spot
    const act = this.styleKeys.has(key) && !this.byKey.has(key) ? null : this.act(words);
    if (act) return act;
    const { stop, never } = this.table;
    const stops =
      words.length > 0 && (stop.includes(words[0]!) || words.some((word) => never.includes(word)));
    if (stops || (key && this.still.has(key))) return stepOf("stop");
    return this.styledOrder(words) ?? this.order(words);
  }

  /** The act or order of words before a place or a comparison, which it leaves out, as in "limp to the door". */
  private goneSomewhere(all: readonly string[]): Step | null {
    const { where, articles, compared } = this.table;
    const at = all.findIndex((word, i) => {
      const isPlace = where.includes(word) && articles.includes(all[i + 1] ?? "");
      return i > 0 && (isPlace || compared.includes(word));
    });
    if (at < 0 || at + 1 === all.length) return null;
    const isPace = (word: string) => this.table.slow.includes(word) || this.table.fast.includes(word);
    const place = all.slice(at).filter((word) => !isPace(word));
    const step = this.step([...all.slice(0, at), ...all.slice(at).filter(isPace)]);
    return step?.name ? { ...step, lacking: place.join(" ") } : null;
  }

  /** The act of words, with its side, tempo and count. */
  private act(words: readonly string[]): Step | null {
    const { slow, fast, loud } = this.table;
    const [timeless, count] = this.withoutTimes(words);
    const plain = timeless.filter((word) => !slow.includes(word) && !fast.includes(word));
    const bare = plain.filter((word) => this.number(word) === null);
    const number = plain.map((word) => this.number(word)).find((value) => value !== null);
    const repeats = number ?? count;
    // as it is said, then without what may be said beside a name: a side, a limb, a number, "loudly"
    const tries: [tried: readonly string[], times: number, isSided: boolean][] = [[words, 1, false]];
    for (const beside of [[], loud]) {
      const rest = plain.filter((word) => !beside.includes(word));
      const fewer = bare.filter((word) => !beside.includes(word));
      tries.push([rest, count, false], [fewer, repeats, false]);
      tries.push([this.withoutSides(rest), count, true], [this.withoutSides(fewer), repeats, true]);
    }
    for (const [tried, times, isSided] of tries) {
      const side = isSided ? this.side(words) : "";
      const name = this.named(tried, side, isSided);
      if (name === null) continue;
      const tempo = tried === words ? 1 : this.tempo(words);
      return stepOf("act", { name, side, tempo, count: clamp(times, 1, SPOKEN.MOST_TIMES) });
    }
    return null;
  }

  private tempo(words: readonly string[]): number {
    const { slow, fast } = this.table;
    if (words.some((word) => fast.includes(word))) return SPOKEN.FAST_FACTOR;
    return words.some((word) => slow.includes(word)) ? SPOKEN.SLOW_FACTOR : 1;
  }

  /** The act that words name, perhaps beside its limb; it has to have a side where one is said. */
  private named(words: readonly string[], side: string, isSided: boolean): string | null {
    const dropped = words.filter((word) => this.limbs.has(word));
    const bare = words.filter((word) => !this.limbs.has(word));
    const tries: [tried: readonly string[], limbs: readonly string[]][] = [
      [words, []],
      [bare, dropped],
    ];
    for (const [tried, limbs] of tries) {
      const name = tried.length ? this.byKey.get(this.key(tried)) : undefined;
      if (name === undefined) continue;
      const act = this.acts.get(name)!;
      if (limbs.every((limb) => act.limbs.has(limb)) && (!isSided || (side && act.side))) return name;
    }
    return null;
  }

  private side(words: readonly string[]): string {
    const sides = Object.entries(this.table.sides).filter(([, names]) =>
      words.some((word) => names.includes(word)),
    );
    return sides.length === 1 ? sides[0]![0] : "";
  }

  private withoutSides(words: readonly string[]): string[] {
    const names = Object.values(this.table.sides).flat();
    return words.filter((word) => !names.includes(word));
  }

  /** Words without "twice" or "3 times", and how often that is. */
  private withoutTimes(words: readonly string[]): [rest: string[], count: number] {
    for (const [at, word] of words.entries()) {
      const number = this.number(word);
      if (number === null) continue;
      if (at + 1 < words.length && this.table.times.includes(words[at + 1]!))
        return [[...words.slice(0, at), ...words.slice(at + 2)], number];
      if (["once", "twice", "thrice", "repeatedly"].includes(word))
        return [[...words.slice(0, at), ...words.slice(at + 1)], number];
    }
    return [[...words], 1];
  }

  private number(word: string): number | null {
    if (/^[0-9]+$/.test(word)) return Number(word.slice(0, 6));
    return Object.hasOwn(this.table.counts, word) ? this.table.counts[word]! : null;
  }

  /** The order of words of which some name a style, as in "limp backwards"; null for any other. */
  private styledOrder(words: readonly string[]): Step | null {
    const spoken = words.map((word) => this.root(word));
    const goes = spoken.some((root) => this.isGait(root));
    for (const { roots, namesGait, style } of this.styles) {
      if (!roots.every((root) => spoken.includes(root)) || (namesGait && !goes)) continue;
      const rest = words.filter((word) => !roots.includes(this.root(word)));
      const step = this.order(goes ? rest : [...rest, this.gaits[0]!]);
      return step && { ...step, style: style === STYLES.NO_STYLE ? "" : style };
    }
    return null;
  }

  /** The order of words to go, turn or change the pace; null for any other word among them. */
  private order(words: readonly string[]): Step | null {
    const side = this.side(words);
    const pace = this.tempo(words);
    const passed = [...this.table.slow, ...this.table.fast, ...this.table.loud];
    const kinds: string[] = [];
    let numbers: number[] = [];
    const [timeless, count] = this.withoutTimes(words);
    for (const word of this.withoutSides(timeless)) {
      const kind = this.kinds.get(stem(word));
      const number = this.number(word);
      if (kind !== undefined) kinds.push(kind);
      else if (number !== null) numbers.push(number);
      else if (!passed.includes(word)) return null;
    }
    // twice is two steps, or twice as many degrees
    if (count !== 1) {
      const usual = kinds.includes("step") ? 1 : 90;
      numbers = (numbers.length ? numbers : [usual]).map((value) => count * value);
    }
    const hasUnit = ["turn", "degrees", "step"].some((kind) => kinds.includes(kind));
    if (numbers.length > (hasUnit ? 1 : 0)) return null;
    if (!kinds.length && !side) return pace === 1 ? null : stepOf("go", { change: pace });
    return this.gone(kinds, side, numbers[0] ?? null, pace);
  }

  /** The order of kinds of words, a side, a number and a pace. */
  private gone(kinds: readonly string[], side: string, number: number | null, pace: number): Step | null {
    const has = (kind: string) => kinds.includes(kind);
    if (has("faster") || has("slower")) {
      return side ? null : stepOf("go", { change: has("faster") ? SPOKEN.FAST_FACTOR : SPOKEN.SLOW_FACTOR });
    }
    if (kinds.length === 1 && has("turn") && !side) return null;
    const sign = side === "right" ? -1 : 1;
    const jogs = has("jog");
    // "walk like a zombie" is its gait
    const gait = this.gaits.findLast(has) ?? (jogs ? "run" : "");
    if (!gait && !SPOKEN.GOING_KINDS.some(has)) {
      return stepOf("go", { way: sign * (has("around") ? 180 : (number ?? 90)) });
    }
    const steps = has("step");
    const [way, aside] = wayOf(kinds, side, number === null || steps ? 90 : number);
    return stepOf("go", {
      name: gait || this.gaits[0]!,
      pace: jogs ? pace * SPOKEN.JOG : pace,
      way,
      aside,
      curve: has("circle") ? sign * SPOKEN.CURVE : 0,
      seconds: steps ? SPOKEN.STEP * (number || 2) : 0,
    });
  }

  /** The names that are most like a text that is not known. */
  private nearest(text: string): string[] {
    const meant = (phrase: string) => wordsOf(phrase).filter((word) => !this.idle.has(word));
    const words = meant(text);
    const stems = new Set(words.map(stem));
    const pairs = pairsOf(words.join(" "));
    const scores = [...this.acts.values()].map(({ name, phrases }, at) => {
      const likeness = phrases.map(meant).map((others) => {
        return 2 * share(stems, new Set(others.map(stem))) + share(pairs, pairsOf(others.join(" ")));
      });
      return { name, at, best: Math.max(0, ...likeness) };
    });
    scores.sort((a, b) => b.best - a.best || a.at - b.at);
    return scores.slice(0, SPOKEN.OFFERED).map(({ name }) => name);
  }
}

/** Whether a step is done together with the one before it: an act with what goes somewhere, and no turn. */
function isDoneWith(step: Step, before: Step): boolean {
  if (before.kind === "stop" || step.kind === "stop") return false;
  if (step.kind === "act") return before.kind !== "act" && !isTurn(before);
  return before.kind !== "act" || (step.kind === "go" && !isTurn(step));
}

function isTurn({ kind, name, way }: Step): boolean {
  return kind === "go" && !name && way !== 0;
}

/** Degrees to the left, and whether the facing stays, of kinds of words and a side. */
function wayOf(kinds: readonly string[], side: string, degrees: number): [way: number, aside: boolean] {
  const has = (kind: string) => kinds.includes(kind);
  const aside = has("backwards") || has("sideways") || (has("step") && (side !== "" || has("back")));
  if (has("backwards") || has("back") || has("around")) return [180, aside];
  const turns = (side !== "" || has("sideways")) && !has("circle");
  return [turns ? (side === "right" ? -degrees : degrees) : 0, aside];
}

const MARKS = [",", ".", ";", "!", "?"];

/** The words, numbers and stops of a text, in lower case, apostrophes left out. */
function wordsOf(text: string): string[] {
  const plain = text.toLowerCase().replace(/['’`]/gu, "").replaceAll("after that", "then");
  return plain.match(/\p{L}+|[0-9]+|[,.;!?]/gu) ?? [];
}

/** The parts of words between some of them. */
function split(words: readonly string[], at: readonly string[]): string[][] {
  const parts: string[][] = [[]];
  for (const word of words) {
    if (at.includes(word)) parts.push([]);
    else parts.at(-1)!.push(word);
  }
  return parts;
}

/** The pairs of letters that follow each other. */
function pairsOf(text: string): Set<string> {
  const letters = [...text];
  return new Set(letters.slice(1).map((letter, at) => letters[at]! + letter));
}

/** How much two sets have in common, from 0 to 1. */
function share(first: Set<string>, second: Set<string>): number {
  if (!first.size || !second.size) return 0;
  const both = [...first].filter((item) => second.has(item)).length;
  return (2 * both) / (first.size + second.size);
}
