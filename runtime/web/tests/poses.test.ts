import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import { GenerateModel, load, poser, posesOf } from "../src/index.js";
import { rotationOf, type Vector } from "../src/motion/rotations.js";

/** A vector turned by a quaternion. */
function turned([x, y, z, w]: [number, number, number, number], [a, b, c]: Vector): Vector {
  const p = 2 * (y * c - z * b);
  const q = 2 * (z * a - x * c);
  const r = 2 * (x * b - y * a);
  return [a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p];
}

test("generate gives poses that walk forward, bones turned as the frames say", async () => {
  const model = (await load(
    new Uint8Array(await readFile("../motet/bundles/generate.zip")),
  )) as GenerateModel;
  const { frames } = (await model.generate("a person walks forward", { seed: 3, seconds: 3 }))[0]!;
  const poses = posesOf(frames, model.manifest);
  assert.equal(poses.length, 90);
  const [x, height, z] = poses.at(-1)!.hips;
  assert.ok(
    Math.hypot(x, z) > 2 && Math.hypot(x, z) < 6 && height > 0.8 && height < 1.1,
    `${x} ${height} ${z}`,
  );
  const bones = Object.keys(poses[0]!.rotations);
  assert.equal(bones.length, 22);
  for (const at of [1, 45, 89]) {
    bones.slice(1).forEach((bone, i) => {
      const [own, upright] = rotationOf(frames[at]!, 4 + 6 * (i + 1));
      const found = [
        turned(poses[at]!.rotations[bone]!, [1, 0, 0]),
        turned(poses[at]!.rotations[bone]!, [0, 1, 0]),
      ];
      [...own, ...upright].forEach((value, k) => assert.ok(Math.abs(found.flat()[k]! - value) < 1e-5, bone));
    });
  }
  assert.deepEqual(
    (await model.generate("a person walks forward", { seed: 3, seconds: 3 }))[0]!.frames,
    frames,
  );
});

test("pieces of a stream are posed like the whole story", async () => {
  const model = await load(new Uint8Array(await readFile("../motet/bundles/generate.zip")), GenerateModel);
  const settings = { seed: 2, seconds: 2 };
  const pose = poser(model.manifest);
  const poses: ReturnType<typeof posesOf> = [];
  for await (const frames of model.stream("a person turns around", settings)) poses.push(...pose(frames));
  assert.deepEqual(
    poses,
    posesOf((await model.story("a person turns around", settings)).frames, model.manifest),
  );
});
