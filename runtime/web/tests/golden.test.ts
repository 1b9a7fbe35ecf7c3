/* Every graph and every run of the shipped bundles gives the golden vectors that Python's runtime gave. */
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import { type NumberArray, rows } from "../src/arrays.js";
import { Bundle } from "../src/bundle.js";
import { DescribeModel, FillModel, GenerateModel, load, PredictModel, SearchModel } from "../src/models.js";
import { Recorded } from "../src/random.js";

const bytes = async (name: string) => new Uint8Array(await readFile(`../motet/bundles/${name}.zip`));

function close(found: ArrayLike<number>, wanted: NumberArray, what: string): void {
  assert.equal(found.length, wanted.data.length, what);
  const expected = Array.from(wanted.data, Number);
  const size = Math.sqrt(expected.reduce((sum, value) => sum + value ** 2, 0) / expected.length);
  const off = expected.map((value, at) => Math.abs(found[at]! - value) / Math.max(1, size, Math.abs(value)));
  const worst = off.indexOf(Math.max(...off));
  assert.ok(off[worst]! <= 1e-4, `${what}: ${off[worst]} at ${worst}: ${found[worst]}, not ${expected[worst]}`);
}

const flat = (frames: ArrayLike<number>[]) => frames.flatMap((frame) => Array.from(frame));

for (const name of ["describe", "generate", "predict", "fill", "search"]) {
  test(`graphs of ${name}`, async () => {
    const bundle = await Bundle.open(await bytes(name));
    const golden = await bundle.golden();
    for (const [role, spec] of Object.entries(bundle.manifest.graphs)) {
      const inputs = Object.fromEntries(spec.inputs.map((input) => [input.name, golden.get(`${role}.in.${input.name}`)!]));
      const outputs = await (await bundle.graph(role)).run(inputs);
      for (const output of spec.outputs) close(outputs[output.name]!.data, golden.get(`${role}.out.${output.name}`)!, `${role} ${output.name}`);
    }
  });
}

async function loaded<T>(name: string, kind: new (...given: never[]) => T) {
  const data = await bytes(name);
  const model = await load(data);
  assert.ok(model instanceof kind);
  const golden = await (await Bundle.open(data)).golden();
  const frames = (key: string) => rows(golden.get(`run.in.${key}`) as NumberArray<Float32Array>);
  const wanted = (key: string) => golden.get(`run.out.${key}`)!;
  return { model: model as T, frames, wanted, run: model.manifest.golden.run, golden };
}

test("describe says what Python says", async () => {
  const { model, frames, wanted } = await loaded("describe", DescribeModel);
  const found = await model.hypotheses(frames("frames"));
  const { data, shape } = wanted("ids");
  const ids = found.map((one) => [...one.ids, ...Array<number>(shape[1]! - one.ids.length).fill(0)]);
  assert.deepEqual(ids.flat(), Array.from(data, Number));
  close(found.map((one) => one.logProbability), wanted("log_probabilities"), "log-probabilities");
});

test("generate draws what Python draws", async () => {
  const { model, wanted, run, golden } = await loaded("generate", GenerateModel);
  assert.deepEqual(model.vocabulary.encode(String(run.text)).ids, Array.from(wanted("ids").data, Number));
  const noise = new Recorded(rows(golden.get("run.in.uniform") as NumberArray<Float32Array>)[Symbol.iterator]());
  const [best] = await model.drawn(String(run.text), Array(Number(run.hypotheses)).fill(noise), { seconds: Number(run.seconds) });
  const { mean, std } = model.manifest.motion;
  const normalised = best!.map((frame) => frame.map((value, at) => (std[at] ? Math.max(-50, Math.min(50, (value - mean[at]!) / std[at]!)) : 0)));
  close(flat(normalised), wanted("frames"), "frames");
});

test("predict continues as Python does", async () => {
  const { model, frames, wanted, run } = await loaded("predict", PredictModel);
  close(flat(await model.predict(frames("frames"), Number(run.frames))), wanted("frames"), "frames");
});

test("fill fills as Python does", async () => {
  const { model, frames, wanted, run } = await loaded("fill", FillModel);
  close(flat(await model.fill(frames("past"), frames("after"), Number(run.frames))), wanted("filled"), "filled");
});

test("search embeds as Python does", async () => {
  const { model, frames, wanted, run } = await loaded("search", SearchModel);
  close(await model.embedMotion(frames("frames")), wanted("motion"), "motion");
  const vector = await model.embedText(String(run.text));
  close(vector, wanted("text"), "text");
  assert.equal(model.nearest(vector, [await model.embedMotion(frames("frames")), vector], 1)[0]!.index, 1);
});
