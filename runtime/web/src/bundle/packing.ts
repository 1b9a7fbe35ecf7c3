/* Arrays in JSON: gzipped, column by column, of each column first all first bytes; as motet/bundle/packing.py packs them. */
import { halves } from "./arrays.js";

const KINDS = {
  f4: Float32Array,
  i1: Int8Array,
  u1: Uint8Array,
  i4: Int32Array,
  i2: Int16Array,
  u2: Uint16Array,
  f2: Uint16Array,
};

/** Tables one after the other. bytes: base64. */
export interface Packed {
  tables: Record<string, { kind: keyof typeof KINDS; shape: [rows: number, width: number] }>;
  bytes: string;
}

/** The bytes of base64. */
export function bytesOf(text: string): Uint8Array<ArrayBuffer> {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let at = 0; at < bytes.length; at++) bytes[at] = letters.charCodeAt(at);
  return bytes;
}

/** The tables, row by row; halves as Float32Array. */
export async function unpacked({ tables, bytes: text }: Packed): Promise<Record<string, ArrayLike<number>>> {
  const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays: Record<string, ArrayLike<number>> = {};
  let at = 0;
  for (const [name, { kind, shape }] of Object.entries(tables)) {
    const [rows, width] = shape;
    const size = KINDS[kind].BYTES_PER_ELEMENT;
    const target = new Uint8Array(rows * width * size);
    for (let column = 0; column < width; column++) {
      for (let byte = 0; byte < size; byte++) {
        for (let row = 0; row < rows; row++) target[(row * width + column) * size + byte] = bytes[at++]!;
      }
    }
    arrays[name] = kind === "f2" ? halves(new Uint16Array(target.buffer)) : new KINDS[kind](target.buffer);
  }
  return arrays;
}
