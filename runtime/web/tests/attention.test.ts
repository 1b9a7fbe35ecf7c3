/* A net that attends to the encoder's states gives Python's answers, and its scores are those of its hypotheses. */
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import { Bundle, DescribeModel, load } from "../src/index.js";
import { type NumberArray, rows } from "../src/bundle/arrays.js";

const data = new Uint8Array(await readFile("../../tests/runtime/attentive.zip"));
const golden = await (await Bundle.open(data)).golden();
const frames = rows(golden.get("run.in.frames") as NumberArray<Float32Array>);
const model = (await load(data)) as DescribeModel;

test("a beam attends as in Python", async () => {
  const { data: ids, shape } = golden.get("run.out.ids")!;
  const wanted = golden.get("run.out.log_probabilities")!.data;
  const found = await model.hypotheses(frames);
  const padded = found.map((one) => [...one.ids, ...Array<number>(shape[1]! - one.ids.length).fill(0)]);
  assert.deepEqual(padded.flat(), Array.from(ids, Number));
  for (const [at, { logProbability }] of found.entries())
    assert.ok(Math.abs(logProbability - Number(wanted[at])) < 1e-4);
});

test("draws and scores attend, too", async () => {
  for (const { text, logProbability } of await model.describe(frames, { draws: 30, beams: 3 }))
    if (text) assert.ok(Math.abs((await model.score(frames, text)) - logProbability) < 1e-4);
});
