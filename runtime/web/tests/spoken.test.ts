/* Sentences and acts by name: as Python reads them and makes them (tests/runtime/test_spoken.py writes said.json). */
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import { entryOf, type GivenActs, Repertoire } from "../src/steering/repertoire.js";
import type { ActModel } from "../src/steering/acts.js";
import { captionOf, type Reading, Words } from "../src/steering/spoken.js";
import said from "./said.json";

const file = JSON.parse(await readFile("../motet/steering/repertoire.json", "utf8")) as GivenActs;
const acts = file.acts.map((act) => [act.name, entryOf(act)] as [string, ReturnType<typeof entryOf>]);
const words = new Words(file.words, acts, ["walk", "run", "skip", "zombie"]);

test("sentences are read as Python reads them", () => {
  for (const [text, wanted] of said.said as unknown as [string, Reading & { caption: string }][]) {
    const reading = words.read(text);
    assert.deepEqual({ ...reading, caption: captionOf(reading) }, wanted, text);
  }
});

test("every name and synonym leads to its act", () => {
  for (const [name, { phrases }] of acts) {
    for (const phrase of phrases) {
      const { steps } = words.read(phrase);
      assert.deepEqual(
        [steps.length, steps[0]?.kind, steps[0]?.name, steps[0]?.side],
        [1, "act", name, ""],
        phrase,
      );
    }
  }
});

test("what is not known names three, and is not done", () => {
  const { steps, unknown, nearest } = words.read("walk, then juggle plates");
  assert.deepEqual([steps.length, unknown, new Set(nearest).size], [0, "juggle plates", 3]);
});

test("acts are made as Python makes them", async () => {
  const repertoire = await Repertoire.of(file, null as unknown as ActModel);
  for (const { asked, count, frames } of said.performed) {
    const made = repertoire.performance(...(asked as [string, string, number, number]));
    assert.equal(made.length, count);
    frames.forEach((frame, at) =>
      frame.forEach((value, i) =>
        assert.ok(Math.abs(made[20 * at]![i]! - value) < 2e-6, `${asked[0]}, ${at}`),
      ),
    );
  }
});
