/* What `npm pack` packs, installed into an empty project, does what the README says, types included. */
import assert from "node:assert/strict";
import { execFile, execFileSync } from "node:child_process";
import { mkdtemp, readFile, rm, stat, symlink, writeFile } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import test from "node:test";
import { promisify } from "node:util";

const KILOBYTES = 136;

test("the packed module is small, and the README's example runs in a new project", async () => {
  const folder = await mkdtemp(join(tmpdir(), "motet-packed-"));
  const run = (command: string, ...given: string[]) =>
    execFileSync(command, given, { cwd: folder, encoding: "utf8" });
  execFileSync("npm", ["run", "-s", "build"], { stdio: ["ignore", "ignore", "pipe"] });
  const [{ filename }] = JSON.parse(
    execFileSync("npm", ["pack", "--json", "--pack-destination", folder], { encoding: "utf8" }),
  );
  assert.ok((await stat(join(folder, filename))).size < 1024 * KILOBYTES);
  await writeFile(join(folder, "package.json"), JSON.stringify({ private: true, type: "module" }));
  run("npm", "install", "--offline", "--no-audit", "--no-fund", `./${filename}`);
  await symlink(resolve("node_modules/onnxruntime-web"), join(folder, "node_modules/onnxruntime-web"));

  const example = /```js\n([^]*?)```/.exec(await readFile("README.md", "utf8"))![1]!;
  const server = createServer(async (request, response) => {
    response.end(await readFile(`../motet${request.url}`));
  }).listen(0);
  const { port } = server.address() as { port: number };
  const said =
    "console.log(JSON.stringify([frames.length, next.length, next[0].length === channels.length]));";
  await writeFile(
    join(folder, "main.ts"),
    example.replaceAll('"/bundles', `"http://localhost:${port}/bundles`) + said,
  );
  try {
    run(
      process.execPath,
      resolve("node_modules/typescript/bin/tsc"),
      "--strict",
      "--module",
      "nodenext",
      "--target",
      "es2022",
      "main.ts",
    );
    const { stdout } = await promisify(execFile)(process.execPath, ["main.js"], { cwd: folder });
    assert.deepEqual(JSON.parse(stdout), [120, 30, true]);
  } finally {
    server.close();
    server.closeAllConnections();
    await rm(folder, { recursive: true });
  }
});
