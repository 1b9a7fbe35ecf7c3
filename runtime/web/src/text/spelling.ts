/* Misspelt words: docs/reference/bundle.md, "Text". */
import { stem } from "./clauses.js";

/** The known word that a misspelt one is meant to be; "" where that is not clear. */
export function corrected(word: string, ...known: string[][]): string {
  const size = [...word].length;
  const most = size >= 8 ? 2 : 1;
  for (let off = 1; off <= most; off++) {
    for (const words of known) {
      const nearest = words.filter(
        (candidate) =>
          candidate[0] === word[0] &&
          candidate.length >= 4 &&
          Math.abs(candidate.length - size) <= most &&
          isSlip(word, candidate) &&
          distance(word, candidate) === off,
      );
      const swapped = nearest.filter((candidate) => letters(candidate) === letters(word));
      const near = swapped.length ? swapped : nearest;
      if (near.length) return new Set(near.map(stem)).size === 1 ? near[0]! : "";
    }
  }
  return "";
}

const letters = (text: string) => [...text].sort().join("");

/** Whether two words differ as in a slip: a short word with another letter, or a letter more, is one of English. */
function isSlip(word: string, other: string): boolean {
  const kinds = (text: string) => [...new Set(text)].sort().join("");
  const size = [...word].length;
  if (size === other.length && size < 8) return letters(word) === letters(other);
  return !(other.length < size && size < 6) || kinds(word) === kinds(other);
}

/** How many letters are added, left out, changed, or swapped with the next one between two words. */
function distance(first: string, second: string): number {
  const a = [...first];
  const b = [...second];
  let before: number[] = [];
  let last = Array.from({ length: b.length + 1 }, (_, at) => at);
  for (let i = 0; i < a.length; i++) {
    const row = [i + 1];
    for (let j = 0; j < b.length; j++) {
      let best = Math.min(last[j + 1]! + 1, row[j]! + 1, last[j]! + (a[i] === b[j] ? 0 : 1));
      if (i && j && a[i] === b[j - 1] && a[i - 1] === b[j]) best = Math.min(best, before[j - 1]! + 1);
      row.push(best);
    }
    before = last;
    last = row;
  }
  return last[b.length]!;
}
