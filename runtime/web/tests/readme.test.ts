import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import test from "node:test";
import * as motet from "../src/index.js";

test("the README's example runs as it stands", async () => {
  const page = await readFile("README.md", "utf8");
  const example = /```js\n([^]*?)```/.exec(page)![1]!;
  const server = createServer(async (request, response) => {
    response.end(await readFile(`../motet${request.url}`));
  }).listen(0);
  const { port } = server.address() as { port: number };
  const code = example.replace(/^import .*$/m, "").replaceAll('"/bundles', `"http://localhost:${port}/bundles`);
  const run = new Function("load", "posesOf", `return (async () => {${code}; return { frames, next, channels }; })()`) as (
    ...given: unknown[]
  ) => Promise<{ frames: number[][]; next: number[][]; channels: string[] }>;
  const { frames, next, channels } = await run(motet.load, motet.posesOf);
  server.close();
  server.closeAllConnections();
  assert.deepEqual([frames.length, next.length, next[0]!.length], [120, 30, channels.length]);
});

test("the README's lines for an avatar and for a dropped file run as they stand", async () => {
  const page = await readFile("README.md", "utf8");
  const [, avatar, dropped] = Array.from(page.matchAll(/```js\n([^]*?)```/g), ([, code]) => code!);
  const load = async (address: string) => motet.load(new Uint8Array(await readFile(`../motet${address}`)));
  const played: { tracks: motet.Track[] }[] = [];
  const given = {
    ...motet,
    load,
    THREE: { AnimationClip: { parse: (clip: motet.Clip) => clip } },
    mixer: { clipAction: (clip: motet.Clip) => ({ play: () => played.push(clip) }) },
    vrm: { meta: { metaVersion: "1" }, humanoid: { getNormalizedBoneNode: (name: string) => ({ name }), normalizedRestPose: { hips: { position: [0, 1, 0] } } } },
    file: { text: () => readFile("tests/written/walk.bvh", "utf8") },
  };
  const run = new Function(...Object.keys(given), `return (async () => {${avatar}${dropped}; return { said, notes }; })()`);
  const { said, notes } = await run(...Object.values(given));
  assert.equal(played[0]!.tracks.length, 23);
  assert.match(said.text, /walk/);
  assert.ok(notes.length > 0);
});
