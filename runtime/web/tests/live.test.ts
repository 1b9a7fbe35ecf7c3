/* What the page saves. */
import assert from "node:assert/strict";
import test from "node:test";
import { toGIF } from "../src/live/gif.js";

test("a GIF has its size and its pictures", () => {
  const picture = (shade: number) =>
    Uint8ClampedArray.from({ length: 4 * 16 * 9 }, (_, at) => (at % 4 === 3 ? 255 : (at * shade) % 256));
  const bytes = toGIF([picture(1), picture(7), picture(7)], 16, 9, 10);
  assert.equal(new TextDecoder().decode(bytes.subarray(0, 6)), "GIF89a");
  assert.deepEqual([...bytes.subarray(6, 10)], [16, 0, 9, 0]);
  assert.equal(bytes.at(-1), 0x3b);
});
