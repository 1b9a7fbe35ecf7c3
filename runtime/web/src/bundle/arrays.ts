import { BundleError } from "../errors.js";
import { openZip } from "./members.js";

export type Numbers =
  | Float32Array
  | Float64Array
  | BigInt64Array
  | Int8Array
  | Uint8Array
  | Int16Array
  | Uint16Array
  | Int32Array;

/** Numbers in C order and their shape. */
export interface NumberArray<T extends Numbers = Numbers> {
  data: T;
  shape: number[];
}

const TYPES = {
  "<f4": Float32Array,
  "<f8": Float64Array,
  "<i8": BigInt64Array,
  "|i1": Int8Array,
  "|u1": Uint8Array,
  "<i2": Int16Array,
  "<u2": Uint16Array,
  "<i4": Int32Array,
} as const;

/** How a manifest calls the types of tables, and how .npy files do. */
export const DTYPES: Record<string, string> = {
  float16: "<f2",
  float32: "<f4",
  float64: "<f8",
  int8: "|i1",
  uint8: "|u1",
  int16: "<i2",
  uint16: "<u2",
  int32: "<i4",
  int64: "<i8",
};

/** "\x93NUMPY" and the version 1.0. */
const MAGIC = [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0];
/** Bytes of a header at most. */
const LONGEST = 1000;

/** A .npy file of version 1.0 in C order, little-endian; float16 becomes float32. BundleError for any other. */
export function readNpy(name: string, bytes: Uint8Array): NumberArray & { descr: string } {
  if (MAGIC.some((byte, at) => bytes[at] !== byte))
    throw new BundleError(`${name} is not a .npy file of version 1.0`);
  const start = 10 + bytes[8]! + 256 * bytes[9]!;
  const text = String.fromCharCode(...bytes.subarray(10, Math.min(start, 10 + LONGEST)));
  const header = /^\{'descr': '([^']+)', 'fortran_order': False, 'shape': \(([0-9, ]*)\), \}\s*$/.exec(text);
  if (!header) throw new BundleError(`${name}: its header is not one that motet writes`);
  const descr = header[1]!;
  const shape = header[2]!
    .split(",")
    .map((size) => size.trim())
    .filter(Boolean)
    .map(Number);
  const count = shape.reduce((product, size) => product * size, 1);
  const width = Number(descr[2]);
  if (bytes.length - start !== count * width)
    throw new BundleError(`${name}: its size does not fit its shape`);
  const raw = bytes.slice(start).buffer;
  if (descr === "<f2") return { data: halves(new Uint16Array(raw)), shape, descr };
  const type = TYPES[descr as keyof typeof TYPES];
  if (!type) throw new BundleError(`${name}: numbers of the type ${descr} are not read`);
  return { data: new type(raw), shape, descr };
}

/** The arrays of an .npz file by name. */
export async function readNpz(bytes: Uint8Array, limit: number): Promise<Map<string, NumberArray>> {
  const zip = openZip(bytes);
  const arrays = new Map<string, NumberArray>();
  for (const name of zip.names)
    arrays.set(name.replace(/\.npy$/, ""), readNpy(name, await zip.read(name, limit)));
  return arrays;
}

/** Numbers of half precision. */
export function halves(bits: Uint16Array): Float32Array {
  const values = new Float32Array(bits.length);
  const words = new Uint32Array(values.buffer);
  for (let at = 0; at < bits.length; at++) {
    const half = bits[at]!;
    const exponent = half & 0x7c00;
    if (exponent && exponent < 0x7c00)
      words[at] = ((half & 0x8000) << 16) | (((half & 0x7fff) + 0x1c000) << 13);
    else
      values[at] =
        (half & 0x8000 ? -1 : 1) * (exponent ? (half & 1023 ? NaN : Infinity) : (half & 1023) * 2 ** -24);
  }
  return values;
}

/** Rows of a two-dimensional array without copies. */
export function rows<T extends Float32Array | Float64Array>({ data, shape }: NumberArray<T>): T[] {
  const width = shape[1]!;
  return Array.from({ length: shape[0]! }, (_, row) => data.subarray(row * width, (row + 1) * width) as T);
}

/** Rows of equal length as one array. */
export function stacked(vectors: ArrayLike<number>[], ...shape: number[]): NumberArray<Float32Array> {
  const width = vectors[0]?.length ?? 0;
  const data = new Float32Array(vectors.length * width);
  vectors.forEach((row, at) => data.set(row, at * width));
  return { data, shape: shape.length ? shape : [vectors.length, width] };
}

/** Frames (T, D) as a batch (1, T, D). */
export function batched(frames: ArrayLike<number>[]): NumberArray<Float32Array> {
  return stacked(frames, 1, frames.length, frames[0]!.length);
}

/** Whole numbers as int64. */
export function integers(values: Iterable<number>, ...shape: number[]): NumberArray<BigInt64Array> {
  const data = BigInt64Array.from(Array.from(values, BigInt));
  return { data, shape: shape.length ? shape : [data.length] };
}
