import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import * as motet from "../src/index.js";

test("the README's lines for an avatar and for a dropped file run as they stand", async () => {
  const page = await readFile("README.md", "utf8");
  const [, steered, avatar, dropped, streamed] = Array.from(
    page.matchAll(/```js\n([^]*?)```/g),
    ([, code]) => code!,
  );
  const load = async (address: string) => motet.load(new Uint8Array(await readFile(`../motet${address}`)));
  let poses = 0;
  const played: { tracks: motet.Track[] }[] = [];
  const given = {
    ...motet,
    load,
    THREE: { AnimationClip: { parse: (clip: motet.Clip) => clip } },
    mixer: { clipAction: (clip: motet.Clip) => ({ play: () => played.push(clip) }) },
    vrm: {
      meta: { metaVersion: "1" },
      humanoid: {
        getNormalizedBoneNode: (name: string) => ({ name }),
        normalizedRestPose: { hips: { position: [0, 1, 0] } },
      },
    },
    play: (pieces: motet.Pose[]) => (poses += pieces.length),
    file: { text: () => readFile("tests/written/walk.bvh", "utf8") },
  };
  const run = new Function(
    ...Object.keys(given),
    `return (async () => {${steered}${avatar}${dropped}${streamed}; return { first, second, said, notes }; })()`,
  );
  const { first, second, said, notes } = await run(...Object.values(given));
  assert.equal(played[0]!.tracks.length, 23);
  assert.ok(Math.abs(second.hips[0] - first.hips[0] - 1.5) < 0.1);
  assert.match(said.text, /walk/);
  assert.ok(notes.length > 0);
  assert.ok(poses > 60, `${poses} poses of a stream`);
});
