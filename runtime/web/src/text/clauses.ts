/* Sentences that ask for several things in a row, as parts: docs/reference/bundle.md, "Several things in one text". */
import { CLAUSES } from "../generated.js";
const STOPS = /(?:[.!?;](?![0-9])|\n)\s*/u;
const THEN =
  /,?\s*\b(?:(?:and|but)\s+)?(?:then|after that|(?<=and )after(?! (?:the|an?|this|his|her|their|your|\w+ing)\b)|afterwards|finally|next(?!\s+to)|before(?=\s+(?:he|she|they|it|you|[\p{L}\p{N}_]+ing)\b)|(?<=\bstops? )to(?=\s+(?!(?:the|an?|his|her|your)\b)))\b,?\s*/iu;
const DIRECTION =
  /\b(?:to (?:the|your|his|her) )?(?:left|right|up|down|forwards?|backwards?|straight(?: ahead)?|ahead)\b/giu;
const TIMES = / (?:once more|again|once|twice|\w+ times)\b/giu;
const SIDE_ALONE =
  /^(?:with |on |(?:switch(?:es)?|changes?|swaps?) to )?(?:the |your |his |her |their )?(left|right)(?: (?:one|foot|hand|leg|arm|knee|side))?$/iu;
const THE_OTHER =
  /^(?:with |on )?(?:the |your |his |her |their )?other(?: (?:one|foot|hand|leg|arm|knee|side))?$/iu;
const TOUCHED = /^(\w+) (?:the|your|his|her|their|my) (?:left |right )?\w+$/iu;
const THING_ALONE = /^(?:the|your|his|her|their|my) (?:left |right )?(?!left|right|one|other|side)\w+$/iu;
const OBJECT =
  /\b(?:an?|the) ([\p{L}\p{N}_]+(?: (?!from|off|of|on|onto|in|into|with|at|to|and|up|down|over|once|twice|[0-9]|\w+ly\b)[\p{L}\p{N}_]+)?)/iu;
const LOW = /\b(?:sit|kneel|lie|lay|crouch|squat|knee)/iu;
const STOOPS = /\b(?:bend|bow|stoop|touch|tie|tying|pick)/iu;
const RISES = /^(?:stand|straighten|get|come)s? (?:back )?up(?: again| straight)?$/iu;
const AROUND = /\b(?:turn\w* (?:a?round|180)|half turn)/iu;
export const ADDRESSEE =
  /^(?:(?:hey|ok|okay) )?(?:robot|avatar|character|bot|dude|buddy|computer|guys?|man|boy|girl),\s+/iu;
const ALSO = /\s*,\s*(?:and\s+)?|\s+and\s+/giu;
/** Words that may stand before the verb of a part: its subject, or an adverb. */
export const SUBJECT =
  /^(?:(?:he|she|they|it|someone|somebody|(?:an?|the|my|our)\s+\w+|\w+ly)(?:\s+(?:is|are))?\s+)+/iu;

/** Words that say little about what is done. */
export const FUNCTION_WORDS: ReadonlySet<string> = new Set(CLAUSES.FUNCTION_WORDS);

const ENDINGS: [RegExp, string][] = [
  [/ies$/u, "y"],
  [/(?:ing|ed|es|s|e)$/u, ""],
  [/y$/u, "i"],
  [/([^aeiou])\1$/u, "$1"],
];

/** What the forms of a lower-case word share: "danc" of dance, dances and dancing. */
export function stem(word: string): string {
  if (word.length <= 3 && !/[ey]$/u.test(word)) return word;
  for (const [ending, rest] of ENDINGS) {
    const shorter = word.replace(ending, rest);
    // the ing of "sing" is no ending
    if (/[aeiouy]/u.test(shorter)) word = shorter;
  }
  return word;
}

/** The stems of those of some words that have a form in -ing among them. */
export function verbsOf(words: Iterable<string>): Set<string> {
  return new Set([...words].filter((word) => word.length > 5 && word.endsWith("ing")).map(stem));
}

const bare = (text: string) => text.replace(/^[ ,]+|[ ,]+$/gu, "");

/** The sentences of a text, and what it has between semicolons and in lines. */
export function sentencesOf(text: string): string[] {
  return text
    .split(STOPS)
    .map((sentence) => bare(sentence).replace(ADDRESSEE, ""))
    .filter(Boolean);
}

/** The parts of a sentence, in the order in which they are done. */
export function partsOf(sentence: string, verbs: Set<string>): string[] {
  const pieces = sentence
    .replace(/^first(?:ly)?\b,?\s*/iu, "")
    .split(THEN)
    .map(bare)
    .filter(Boolean);
  return inFull(pieces.flatMap((piece) => beforeVerbs(piece, verbs)));
}

/** Parts with the words that they share with the part before: "look up", "down". */
function inFull(parts: string[]): string[] {
  const full: string[] = [];
  for (const part of parts) {
    const before = full.at(-1);
    full.push(before === undefined ? part : after(before, part));
  }
  return full;
}

function after(before: string, part: string): string {
  const direction = [...before.matchAll(DIRECTION)].at(-1);
  const direct = part.replace(TIMES, "");
  if (direction && direct.match(DIRECTION)?.[0] === direct) {
    const following = before.slice(direction.index + direction[0].length);
    return (
      before.slice(0, direction.index) + part + (direct === part ? following : following.replace(TIMES, ""))
    );
  }
  const touched = TOUCHED.exec(before);
  if (touched && THING_ALONE.test(part)) return `${touched[1]} ${part}`;
  const side = sideOf(before, part);
  if (side) return before.replace(/\b(?:left|right)\b/gu, side);
  const thing = OBJECT.exec(before.replace(SUBJECT, ""));
  if (thing && /^[\p{L}\p{N}_]+ it\b/u.test(part)) return part.replace(/\bit\b/u, `the ${thing[1]}`);
  if (AROUND.test(before)) return part.replace(/^(walks?|goe?s?) back\b/u, "$1 forward");
  return upright(before, part);
}

/** The side that a part says and nothing else, or that is not that of the part before it; "" where it says none. */
function sideOf(before: string, part: string): string {
  const sides = before.match(/\b(?:left|right)\b/gu) ?? [];
  if (sides.length && THE_OTHER.test(part)) return sides.at(-1) === "right" ? "left" : "right";
  return (sides.length && SIDE_ALONE.exec(part)?.[1]) || "";
}

/** A part that stands up after one that sits, and stands still after one that only bends. */
function upright(before: string, part: string): string {
  if (LOW.test(before)) return /^stands?$/u.test(part) ? `${part} up` : part;
  return RISES.test(part) && STOOPS.test(before) ? "stands still" : part;
}

/** A text cut at each comma and "and" that a verb follows, if one came before. */
function beforeVerbs(text: string, verbs: Set<string>): string[] {
  const parts: string[] = [];
  let start = 0;
  for (const { index, 0: separator } of text.matchAll(ALSO)) {
    const done =
      text
        .slice(start, index)
        .toLowerCase()
        .match(/[\p{L}\p{N}_]+/gu) ?? [];
    const opened =
      /^(?!back (?!up|away|off)|holds? (?:[\p{L}\p{N}_]+ )?for|(?:left|right)\b)[\p{L}\p{N}_]+/u.exec(
        text
          .slice(index + separator.length)
          .replace(SUBJECT, "")
          .toLowerCase(),
      );
    if (!opened || !verbs.has(stem(opened[0])) || !done.some((word) => verbs.has(stem(word)))) continue;
    parts.push(text.slice(start, index));
    start = index + separator.length;
  }
  return [...parts, text.slice(start)];
}
