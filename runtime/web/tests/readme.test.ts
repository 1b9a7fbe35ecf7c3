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
