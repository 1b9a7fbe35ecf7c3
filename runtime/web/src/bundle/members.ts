import { BundleError } from "../errors.js";

/** The files of a zip by name, unpacked when they are asked for. */
export interface Archive {
  names: string[];
  /** The bytes of a file, at most `limit`: BundleError for a larger one. */
  read(name: string, limit: number): Promise<Uint8Array>;
}

const END = 0x06054b50;
const ENTRY = 0x02014b50;
const LOCAL = 0x04034b50;

/** Open a zip without sub-folders, stored or deflated; BundleError for any other. */
export function openZip(bytes: Uint8Array): Archive {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const entries = new Map<string, { method: number; packed: number; size: number; at: number }>();
  try {
    let end = bytes.length - 22;
    while (view.getUint32(end, true) !== END) end--;
    let at = view.getUint32(end + 16, true);
    for (let left = view.getUint16(end + 10, true); left > 0; left--) {
      if (view.getUint32(at, true) !== ENTRY) throw new RangeError();
      const length = view.getUint16(at + 28, true);
      const name = new TextDecoder("utf-8", { fatal: true }).decode(
        bytes.subarray(at + 46, at + 46 + length),
      );
      if (entries.has(name) || !/^[A-Za-z0-9_][A-Za-z0-9_.-]*$/.test(name)) {
        throw new BundleError(`the zip has a file of an improper name, ${JSON.stringify(name.slice(0, 60))}`);
      }
      entries.set(name, {
        method: view.getUint16(at + 10, true),
        packed: view.getUint32(at + 20, true),
        size: view.getUint32(at + 24, true),
        at: view.getUint32(at + 42, true),
      });
      at += 46 + length + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
    }
  } catch (error) {
    throw error instanceof BundleError ? error : new BundleError("not a zip, or a damaged one");
  }

  async function read(name: string, limit: number): Promise<Uint8Array> {
    const entry = entries.get(name);
    if (!entry) throw new BundleError(`the file ${JSON.stringify(name)} is missing`);
    if (entry.at + 30 > bytes.length || view.getUint32(entry.at, true) !== LOCAL)
      throw new BundleError(`${name}: damaged`);
    const start = entry.at + 30 + view.getUint16(entry.at + 26, true) + view.getUint16(entry.at + 28, true);
    const packed = bytes.subarray(start, start + entry.packed);
    if (entry.method === 0) return bounded(name, [packed], limit);
    if (entry.method !== 8) throw new BundleError(`${name}: packed by the unknown method ${entry.method}`);
    return inflate(name, packed, limit);
  }
  return { names: [...entries.keys()], read };
}

async function inflate(name: string, packed: Uint8Array, limit: number): Promise<Uint8Array> {
  const unpacked = new Blob([packed as BlobPart])
    .stream()
    .pipeThrough(new DecompressionStream("deflate-raw"));
  const reader = unpacked.getReader();
  const chunks: Uint8Array[] = [];
  let size = 0;
  try {
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      chunks.push(part.value);
      size += part.value.length;
      if (size > limit) break;
    }
  } catch {
    throw new BundleError(`${name}: damaged`);
  }
  await reader.cancel();
  return bounded(name, chunks, limit);
}

function bounded(name: string, chunks: Uint8Array[], limit: number): Uint8Array {
  const whole = joined(chunks);
  if (whole.length > limit)
    throw new BundleError(`the file ${JSON.stringify(name)} has more than ${limit} bytes`);
  return whole;
}

/** Bytes one after the other. */
export function joined(chunks: Uint8Array[]): Uint8Array {
  const whole = new Uint8Array(chunks.reduce((sum, chunk) => sum + chunk.length, 0));
  let at = 0;
  for (const chunk of chunks) {
    whole.set(chunk, at);
    at += chunk.length;
  }
  return whole;
}

/** Bytes as hexadecimal digits. */
export function hexOf(bytes: Uint8Array): string {
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
