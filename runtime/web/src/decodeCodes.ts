import { integers } from "./arrays.js";
import type { Graph } from "./graph.js";
import { moved, type Pose, seenFrom } from "./planar.js";

/**
 * Frames (T, D) of `root_sixd` in the contract's units, of steps of codes (N, P), from the origin: the decoder's first
 * three channels are the root seen from where the moves have led, and become rates a second.
 */
export async function framesOf(decoder: Graph, codes: number[][], fps: number): Promise<Float32Array[]> {
  const found = await decoder.run({ codes: integers(codes.flat(), 1, codes.length, codes[0]!.length) });
  const { data, shape } = found.frames!;
  const [steps, hop, width] = [shape[1]!, shape[2]!, shape[3]!];
  const frames: Float32Array[] = [];
  const poses: Pose[] = [];
  let way: Pose = [0, 0, 0];
  for (let step = 0; step < steps; step++) {
    for (let frame = step * hop; frame < (step + 1) * hop; frame++) {
      const row = data.slice(frame * width, (frame + 1) * width);
      poses.push(moved(way, [row[0]!, row[1]!, row[2]!]));
      frames.push(row);
    }
    const move = found.moves!.data.subarray(3 * step, 3 * step + 3);
    way = moved(way, [move[0]!, move[1]!, move[2]!]);
  }
  frames.forEach((row, at) => {
    const later = Math.max(at, 1); // the first frame has the second one's rates
    seenFrom(poses[later - 1]!, poses[later]!).forEach((rate, channel) => (row[channel] = rate * fps));
  });
  return frames;
}
