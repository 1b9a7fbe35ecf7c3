/* What the page saves, and where on its ground a click is. */
import assert from "node:assert/strict";
import test from "node:test";
import { toGIF } from "../src/live/gif.js";
import { landscape, metBy } from "../src/live/landscape.js";
import { minus, type Vector } from "../src/motion/rotations.js";

test("a GIF has its size and its pictures", () => {
  const picture = (shade: number) =>
    Uint8ClampedArray.from({ length: 4 * 16 * 9 }, (_, at) => (at % 4 === 3 ? 255 : (at * shade) % 256));
  const bytes = toGIF([picture(1), picture(7), picture(7)], 16, 9, 10);
  assert.equal(new TextDecoder().decode(bytes.subarray(0, 6)), "GIF89a");
  assert.deepEqual([...bytes.subarray(6, 10)], [16, 0, 9, 0]);
  assert.equal(bytes.at(-1), 0x3b);
});

test("a click on the hill or the stair is there, and not on the plane behind it", () => {
  const on = ([x, z]: number[]): Vector => [x!, landscape(x!, z!), z!];
  const eye: Vector = [-2, 2.2, -4];
  const places = [
    [-6, 6], // near the top of the hill
    [-4.5, 4.4], // its slope
    [5.5, 5.45], // the second step of the stair
    [1, 3], // the plane
  ];
  for (const place of places) {
    const [x, z] = metBy(eye, minus(on(place), eye))!;
    assert.ok(Math.hypot(x - place[0]!, z - place[1]!) < 1e-3, `${x}, ${z} of ${place}`);
  }
  assert.ok(
    landscape(...metBy(eye, minus([-8.4, 0, 12.8], eye))!) > 0.3,
    "the plane behind the hill is hidden by it",
  );
  assert.equal(metBy(eye, [0, 0.1, 1]), null);
});
