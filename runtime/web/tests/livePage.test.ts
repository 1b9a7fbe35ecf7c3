/* The script of the page of `motet live` is what is built from here. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFile } from "node:fs/promises";
import test from "node:test";

test("the page's script is up to date: npm run build:live", async () => {
  const built = execFileSync("npm", ["run", "-s", "live", "--", "src/livePage.ts"], { encoding: "utf8" });
  assert.ok(built === (await readFile("../motet/live/control.js", "utf8")), "run npm run build:live");
});
