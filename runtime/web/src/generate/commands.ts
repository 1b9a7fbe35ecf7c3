/* Bare commands, such as "walk", and the plain act that each means: docs/reference/bundle.md, "Bare commands". */
import { CLAUSES } from "../generated.js";
import { BundleError } from "../errors.js";
import { stem } from "../text/clauses.js";

/** An entry of a manifest. */
export interface Command {
  sentence: string;
  action: number;
  texts: string[];
  instead: string[];
}

const POLITE_WORDS: ReadonlySet<string> = new Set(CLAUSES.POLITE_WORDS);

/** The sorted stems of words without those that make no difference to a command, as one text. */
function keyOf(words: string[]): string {
  const stems = words.filter((word) => !POLITE_WORDS.has(word)).map(stem);
  return [...new Set(stems)].sort().join(" ");
}

/** The commands of a bundle. Command i is the action `first + i` of the memory and of contexts. */
export class Commands {
  readonly first: number;
  /** The number of the act of each command, whether it is shown for another one, and the verbs that they begin with. */
  private readonly numbers = new Map<string, { number: number; instead: boolean }>();
  readonly verbs = new Set<string>();

  /**
   * split: the words of a text. meant: the known word of which one is a misspelling. actions: how many known ones there
   * are; the number after them stands for none.
   */
  constructor(
    readonly acts: Command[],
    private readonly split: (text: string) => string[],
    private readonly meant: (word: string) => string,
    actions: number,
  ) {
    this.first = actions + 1;
    for (const [number, act] of acts.entries()) {
      for (const text of act.texts) this.add(text, number, false);
      for (const text of act.instead) this.add(text, number, true);
      for (const text of act.texts) this.verbs.add(stem(split(text)[0]!));
      if (!(act.action >= 0 && act.action < actions))
        throw new BundleError(`manifest, commands: ${act.action} is no action`);
    }
  }

  private add(text: string, number: number, instead: boolean): void {
    const key = keyOf(this.split(text));
    if (!key || (this.numbers.get(key)?.number ?? number) !== number)
      throw new BundleError(`manifest, commands: '${text}' does not mean one act`);
    this.numbers.set(key, { number, instead: this.numbers.get(key)?.instead ?? instead });
  }

  /** The action of the command that a text is. */
  act(text: string): number | undefined {
    const key = this.key(text);
    return this.numbers.has(key) ? this.action(key) : undefined;
  }

  /** The key of a text; of what it means, if it is misspelt. */
  private key(text: string): string {
    const words = this.split(text);
    const key = keyOf(words);
    return this.numbers.has(key) ? key : keyOf(words.map((word) => this.meant(word) || word));
  }

  /** The action of a command. */
  action(key: string): number {
    return this.first + this.numbers.get(key)!.number;
  }

  /** Whether a text is a command for an act that nobody recorded. */
  isInstead(text: string): boolean {
    return this.numbers.get(this.key(text))?.instead ?? false;
  }

  /** The sorted stems of the longest command in a text that begins with a command's verb. */
  nearest(text: string): string[] | undefined {
    const words = this.split(text);
    if (!words.length || !this.verbs.has(stem(words[0]!))) return undefined;
    const inside = new Set(keyOf(words).split(" "));
    let longest: string[] | undefined;
    for (const [key, { instead }] of this.numbers) {
      const stems = key.split(" ");
      if (instead || !stems.includes(stem(words[0]!)) || !stems.every((word) => inside.has(word))) continue;
      const longer = stems.length - (longest?.length ?? 0);
      if (longer > 0 || (longer === 0 && later(stems, longest!))) longest = stems;
    }
    return longest;
  }

  /** The stems of the words that an act does not leave out: those of its commands, and polite ones. */
  stems(action: number): Set<string> {
    const { texts } = this.acts[action - this.first]!;
    return new Set([...POLITE_WORDS, ...texts.flatMap((text) => this.split(text))].map(stem));
  }
}

/** Whether sorted stems come after others. */
function later(stems: string[], others: string[]): boolean {
  for (const [at, word] of stems.entries()) if (word !== others[at]) return word > others[at]!;
  return false;
}
