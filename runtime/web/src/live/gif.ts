/* Animated GIF (GIF89a): up to 255 colours for all pictures, and pixels that stay are left as they are. */

/** Pictures of RGBA pixels, row by row. delay: hundredths of a second of each. */
export function toGIF(
  pictures: Uint8ClampedArray[],
  width: number,
  height: number,
  delay: number,
): Uint8Array<ArrayBuffer> {
  const { palette, nearest } = paletteOf(pictures);
  const out: number[] = [..."GIF89a"].map((letter) => letter.charCodeAt(0));
  const word = (value: number) => out.push(value & 255, value >> 8);
  word(width);
  word(height);
  out.push(0xf7, 0, 0, ...palette.flat());
  out.push(0x21, 0xff, 11, ...[..."NETSCAPE2.0"].map((letter) => letter.charCodeAt(0)), 3, 1, 0, 0, 0);
  let before: Uint8Array | null = null;
  for (const picture of pictures) {
    const pixels = Uint8Array.from({ length: width * height }, (_, at) => nearest[bin(picture, 4 * at)]!);
    const shown = before ? pixels.map((colour, at) => (colour === before![at] ? CLEAR : colour)) : pixels;
    out.push(0x21, 0xf9, 4, 0x05, delay & 255, delay >> 8, CLEAR, 0, 0x2c, 0, 0, 0, 0);
    word(width);
    word(height);
    out.push(0, 8);
    for (const block of blocks(packed(shown))) out.push(block.length, ...block);
    out.push(0);
    before = pixels;
  }
  out.push(0x3b);
  return Uint8Array.from(out);
}

/** The number of the colour that leaves a pixel as it was. */
const CLEAR = 255;

/** A colour by the first five bits of red, green and blue. */
function bin(pixels: Uint8ClampedArray, at: number): number {
  return ((pixels[at]! >> 3) << 10) | ((pixels[at + 1]! >> 3) << 5) | (pixels[at + 2]! >> 3);
}

const colourOf = (bin: number) => [10, 5, 0].map((shift) => ((bin >> shift) & 31) * 8 + 4);

/** The colours that most pixels have, 256 with the clear one, and for each colour by five bits the nearest of them. */
function paletteOf(pictures: Uint8ClampedArray[]): { palette: number[][]; nearest: Uint8Array } {
  const counts = new Float64Array(1 << 15);
  for (const picture of pictures) for (let at = 0; at < picture.length; at += 4) counts[bin(picture, at)]!++;
  const used = [...counts.keys()].filter((index) => counts[index]);
  const palette = used
    .sort((a, b) => counts[b]! - counts[a]!)
    .slice(0, CLEAR)
    .map(colourOf);
  const nearest = new Uint8Array(1 << 15);
  for (const index of used) {
    const colour = colourOf(index);
    const off = palette.map((other) => other.reduce((sum, value, i) => sum + (value - colour[i]!) ** 2, 0));
    nearest[index] = off.indexOf(Math.min(...off));
  }
  while (palette.length <= CLEAR) palette.push([0, 0, 0]);
  return { palette, nearest };
}

/** LZW with codes of 9 to 12 bits, the least bit first. */
function packed(pixels: Uint8Array): Uint8Array {
  const START = 256;
  const END = 257;
  const LAST = 4095;
  const out: number[] = [];
  let held = 0;
  let bits = 0;
  let size = 9;
  const write = (code: number) => {
    held |= code << bits;
    for (bits += size; bits >= 8; bits -= 8, held >>>= 8) out.push(held & 255);
  };
  let known = new Map<number, number>();
  write(START);
  let code = pixels[0]!;
  for (const pixel of pixels.subarray(1)) {
    const next = known.get((code << 8) | pixel);
    if (next !== undefined) {
      code = next;
      continue;
    }
    write(code);
    const fresh = END + 1 + known.size;
    if (fresh > 2 ** size - 1 && size < 12) size++;
    known.set((code << 8) | pixel, fresh);
    if (fresh === LAST) {
      write(START);
      known = new Map();
      size = 9;
    }
    code = pixel;
  }
  write(code);
  write(END);
  if (bits) out.push(held & 255);
  return Uint8Array.from(out);
}

function blocks(bytes: Uint8Array): Uint8Array[] {
  return Array.from({ length: Math.ceil(bytes.length / 255) }, (_, at) =>
    bytes.subarray(255 * at, 255 * at + 255),
  );
}
