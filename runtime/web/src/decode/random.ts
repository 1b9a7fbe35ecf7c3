/*
 * Uniform numbers as numpy's default_rng(seed) gives them: PCG64 (O'Neill 2014, XSL RR 128/64), seeded by SeedSequence.
 * So a seed gives the same motion here as in Python.
 */
const M128 = (1n << 128n) - 1n;
const M64 = (1n << 64n) - 1n;
const MULTIPLIER = 0x2360ed051fc65da44385df649fccf645n;

export interface Noise {
  /** So many uniform numbers in [0, 1), of single precision. */
  uniform(count: number): number[];
}

/** numpy's random.default_rng(seed, spawn_key), as far as uniform float32 numbers go. */
export class Pcg64 implements Noise {
  private state = 0n;
  private readonly increment: bigint;
  private half: bigint | null = null;

  /** spawned: which of the generators that the seed's one spawns, the first being 0. */
  constructor(seed: number, spawned?: number) {
    const words = stateOf(seed, 8, spawned).map(BigInt);
    const [a, b, c, d] = [0, 2, 4, 6].map((at) => words[at]! | (words[at + 1]! << 32n));
    this.increment = ((((c! << 64n) | d!) << 1n) | 1n) & M128;
    this.advance();
    this.state = (this.state + ((a! << 64n) | b!)) & M128;
    this.advance();
  }

  uniform(count: number): number[] {
    return Array.from({ length: count }, () => Number(this.next32() >> 8n) / 2 ** 24);
  }

  private advance(): void {
    this.state = (this.state * MULTIPLIER + this.increment) & M128;
  }

  private next32(): bigint {
    if (this.half !== null) {
      const rest = this.half;
      this.half = null;
      return rest;
    }
    this.advance();
    const mixed = (this.state >> 64n) ^ (this.state & M64);
    const turn = this.state >> 122n;
    const word = ((mixed >> turn) | (mixed << (64n - turn))) & M64;
    this.half = word >> 32n;
    return word & 0xffffffffn;
  }
}

/** The first 32-bit words of numpy's SeedSequence (O'Neill's seed_seq_fe128 with a pool of four words). */
export function stateOf(seed: number, count: number, spawned?: number): number[] {
  const words = seed === 0 ? [0] : [];
  for (let left = BigInt(seed); left > 0n; left >>= 32n) words.push(Number(left & 0xffffffffn));
  if (spawned !== undefined) {
    while (words.length < 4) words.push(0);
    words.push(spawned);
  }
  let constant = 0x43b0d7e5;
  let multiplier = 0x931e8875;
  const hash = (value: number): number => {
    value = (value ^ constant) >>> 0;
    constant = Math.imul(constant, multiplier) >>> 0;
    value = Math.imul(value, constant) >>> 0;
    return (value ^ (value >>> 16)) >>> 0;
  };
  const mix = (x: number, y: number): number => {
    const mixed = (Math.imul(0xca01f9dd, x) - Math.imul(0x4973f715, y)) >>> 0;
    return (mixed ^ (mixed >>> 16)) >>> 0;
  };
  const pool = [0, 1, 2, 3].map((at) => hash(words[at] ?? 0));
  for (let from = 0; from < 4; from++) {
    for (let to = 0; to < 4; to++) if (from !== to) pool[to] = mix(pool[to]!, hash(pool[from]!));
  }
  for (const word of words.slice(4)) for (let to = 0; to < 4; to++) pool[to] = mix(pool[to]!, hash(word));
  constant = 0x8b51f9dd;
  multiplier = 0x58f38ded;
  return Array.from({ length: count }, (_, at) => hash(pool[at % 4]!));
}

/** Noise that is given, block after block, such as that of golden vectors. */
export class Recorded implements Noise {
  constructor(private readonly blocks: Iterator<ArrayLike<number>>) {}

  uniform(count: number): number[] {
    const { value, done } = this.blocks.next();
    if (done || value.length !== count)
      throw new RangeError(`the recording lacks a block of ${count} numbers`);
    return Array.from(value);
  }
}
