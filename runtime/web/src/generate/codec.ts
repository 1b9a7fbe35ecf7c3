/* Frames of steps of codes, and steps of codes of frames: docs/reference/bundle.md, the loop `codes`. */
import { CODEC } from "../generated.js";
import { integers, stacked } from "../bundle/arrays.js";
import type { Graph } from "../bundle/graph.js";
import type { Frames } from "../models/base.js";
import { moved, type Pose, seenFrom } from "../motion/planar.js";
import { dampingOf } from "../motion/springs.js";

/** The graphs `decoder` and `tokens`, how many steps they look back and ahead, and the spring that joins motions. */
export interface Codec {
  decoder: Graph;
  tokens: Graph;
  /** How many moves there are. */
  moves: number;
  back: number;
  ahead: number;
  /** Frames of a step. */
  hop: number;
  fps: number;
  halfLife: number;
}

/** The end of a motion that is continued: frames (G, D), and their steps of codes (N, P). */
export interface Context {
  frames: Frames;
  codes: number[][];
}

/** Steps of codes (N, P) of frames (N hop, D) in the contract's units. */
export async function codesOf(codec: Codec, frames: Frames): Promise<number[][]> {
  const { tokens, hop, fps } = codec;
  const steps = frames.length / hop;
  const width = frames[0]!.length;
  const { data, shape } = (await tokens.run({ frames: stacked(frames, 1, steps, hop, width) })).codes!;
  const body = shape[2]!;
  const book = await bookOf(codec, body + 1);
  const poses: Pose[] = [];
  for (const frame of [...frames, frames.at(-1)!]) {
    poses.push(moved(poses.at(-1) ?? [0, 0, 0], pose(frame).map((rate) => rate / fps) as Pose));
  }
  let way = poses[0]!;
  return Array.from({ length: steps }, (_, step) => {
    const move = nearest(seenFrom(way, poses[(step + 1) * hop]!), book);
    way = moved(way, book[move]!);
    return [move, ...data.subarray(step * body, (step + 1) * body)];
  });
}

/** The moves (M, 3) that codes stand for: the decoder has their numbers. */
async function bookOf({ decoder, moves }: Codec, parts: number): Promise<Pose[]> {
  const codes = Array.from({ length: moves }, (_, move) => [move, ...Array<number>(parts - 1).fill(0)]);
  const { data } = (await decoder.run({ codes: integers(codes.flat(), 1, moves, parts) })).moves!;
  return codes.map((_, at) => pose(data, CODEC.PATH_CHANNELS * at));
}

/** The move that leads nearest to another. */
function nearest([forward, left, turn]: Pose, book: Pose[]): number {
  const off = book.map(
    ([x, z, angle]) => (forward - x) ** 2 + (left - z) ** 2 + (CODEC.RADIAN_METRES * (turn - angle)) ** 2,
  );
  return off.indexOf(Math.min(...off));
}

/** Frames of steps of codes that are pushed as they come, from the origin or after the end of a motion. */
export class StreamingDecoder {
  private codes: number[][];
  private context: Frames | undefined;
  /** Steps of which frames were given; the last one of a context is decoded to be joined. */
  private count: number;
  private way: Pose = [0, 0, 0];
  private pose: Pose | undefined;
  private join: ((frame: Float32Array) => void) | undefined;

  constructor(
    private readonly codec: Codec,
    context?: Context,
  ) {
    this.codes = [...(context?.codes ?? [])];
    this.context = context?.frames.slice(-2);
    this.count = Math.max(0, this.codes.length - 1);
  }

  /** Frames (T, D) in the contract's units that further steps settle: none at first. last: nothing follows. */
  async push(steps: number[][], last = false): Promise<Float32Array[]> {
    const { back, ahead } = this.codec;
    this.codes.push(...steps);
    const frames = await this.settled(this.codes.length - (last ? 0 : ahead));
    const over = Math.max(0, this.count - back); // out of sight
    this.codes = this.codes.slice(over);
    this.count -= over;
    return frames;
  }

  private async settled(until: number): Promise<Float32Array[]> {
    if (until <= this.count) return [];
    const { decoder, back, ahead, hop } = this.codec;
    const start = Math.max(0, this.count - back);
    const part = this.codes.slice(start, until + ahead);
    const { frames, moves } = await decoder.run({
      codes: integers(part.flat(), 1, part.length, part[0]!.length),
    });
    const width = frames!.shape[3]!;
    const decoded: Float32Array[] = [];
    const first = !this.pose;
    for (let step = this.count - start; step < until - start; step++) {
      for (let at = step * hop; at < (step + 1) * hop; at++)
        decoded.push(this.led(frames!.data.slice(at * width, (at + 1) * width)));
      this.way = moved(this.way, pose(moves!.data, CODEC.PATH_CHANNELS * step));
    }
    if (first) decoded[0]!.set(decoded[1]!.subarray(0, CODEC.PATH_CHANNELS)); // the first frame has the second one's rates
    this.count = until;
    return this.joined(decoded);
  }

  /** A frame whose root is seen from the way, with its rates a second instead. */
  private led(frame: Float32Array): Float32Array {
    const next = moved(this.way, pose(frame));
    frame.set(seenFrom(this.pose ?? next, next).map((rate) => rate * this.codec.fps));
    this.pose = next;
    return frame;
  }

  /** Frames that go on from the motion that is continued, if there is one. */
  private joined(frames: Float32Array[]): Float32Array[] {
    const { hop, fps, halfLife } = this.codec;
    if (this.context) {
      this.join = inertialized(this.context, frames.slice(hop - 2, hop), fps, halfLife);
      this.context = undefined;
      frames = frames.slice(hop);
    }
    if (this.join) frames.forEach(this.join);
    return frames;
  }
}

/**
 * Adds to each next frame what is left of what a motion's last two frames are beside those found in their place: by a
 * critically damped spring. What the root's rates are off by is a speed already, and has none.
 */
function inertialized(
  context: Frames,
  frames: Frames,
  fps: number,
  halfLife: number,
): (frame: Float32Array) => void {
  const [before, off] = [0, 1].map((row) =>
    Float64Array.from(context[row]!, (value, at) => value - frames[row]![at]!),
  ) as [Float64Array, Float64Array];
  const speed = off.map((value, at) => (at < CODEC.PATH_CHANNELS ? 0 : (value - before[at]!) * fps));
  const y = dampingOf(halfLife);
  const fading = Math.exp(-y / fps);
  return (frame) => {
    for (let at = 0; at < frame.length; at++) {
      const push = speed[at]! + off[at]! * y;
      off[at] = (off[at]! + push / fps) * fading;
      speed[at] = (speed[at]! - (push * y) / fps) * fading;
      frame[at]! += off[at]!;
    }
  };
}

function pose(numbers: ArrayLike<number>, at = 0): Pose {
  return [numbers[at]!, numbers[at + 1]!, numbers[at + 2]!];
}
