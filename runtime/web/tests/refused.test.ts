/* Bundles, sentences and frames that are wrong are refused by name. */
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import test from "node:test";
import {
  Bundle,
  BundleError,
  DecodingError,
  FillModel,
  type GenerateModel,
  load,
  type PredictModel,
  release,
  type SearchModel,
  TextError,
} from "../src/index.js";
import { checkGraph } from "../src/bundle/graphSafety.js";
import { Pcg64 } from "../src/decode/random.js";
import { openZip } from "../src/bundle/members.js";
import { bundle } from "./bundles.js";

test("bundles with an altered byte are refused, wherever it is read", async () => {
  const whole = await bundle("predict");
  let refused = 0;
  const places = Array.from({ length: 20 }, (_, at) => 100 + Math.floor((at * (whole.length - 200)) / 20));
  for (const place of places) {
    const altered = Uint8Array.from(whole);
    altered[place]! ^= 255;
    await load(altered).catch((error: unknown) => {
      assert.ok(error instanceof BundleError, `${String(error)} at ${place}`);
      refused++;
    });
  }
  assert.ok(refused >= 16, `${refused} of ${places.length}`); // golden vectors are not read
});

test("what is cut short or no bundle is refused", async () => {
  const whole = await bundle("predict");
  for (const damaged of [
    new Uint8Array(),
    whole.subarray(0, 1000),
    whole.subarray(1000),
    new TextEncoder().encode("no zip"),
  ]) {
    await assert.rejects(Bundle.open(damaged), BundleError);
  }
});

/** A zip of files that are stored as they are. */
function zipped(files: Record<string, Uint8Array>): Uint8Array {
  const [local, central]: Uint8Array[][] = [[], []];
  let at = 0;
  for (const [name, data] of Object.entries(files)) {
    const own = new DataView(new ArrayBuffer(30));
    const entry = new DataView(new ArrayBuffer(46));
    own.setUint32(0, 0x04034b50, true);
    entry.setUint32(0, 0x02014b50, true);
    for (const [view, size, length] of [
      [own, 18, 26],
      [entry, 20, 28],
    ] as const) {
      view.setUint32(size, data.length, true);
      view.setUint32(size + 4, data.length, true);
      view.setUint16(length, name.length, true);
    }
    entry.setUint32(42, at, true);
    const text = new TextEncoder().encode(name);
    local!.push(new Uint8Array(own.buffer), text, data);
    central!.push(new Uint8Array(entry.buffer), text);
    at += 30 + text.length + data.length;
  }
  const end = new DataView(new ArrayBuffer(22));
  end.setUint32(0, 0x06054b50, true);
  end.setUint16(10, Object.keys(files).length, true);
  end.setUint32(16, at, true);
  return new Uint8Array(Buffer.concat([...local!, ...central!, new Uint8Array(end.buffer)]));
}

/** The files of a bundle and its manifest, and what loads them with another one. */
async function unpacked(name: string) {
  const zip = openZip(await bundle(name));
  const files: Record<string, Uint8Array> = {};
  for (const file of zip.names) files[file] = await zip.read(file, 1 << 28);
  const manifest = JSON.parse(new TextDecoder().decode(files["manifest.json"]));
  const altered = (text: string) =>
    load(zipped({ ...files, "manifest.json": new TextEncoder().encode(text) }));
  return { files, manifest, altered };
}

test("a graph's weights may be in a file of their own", async () => {
  const { files, manifest, altered } = await unpacked("predict");
  const { graphs } = manifest;
  const whole = files["encoder.onnx"]!;
  files["encoder.onnx"] = whole.subarray(0, 2000);
  files["weights.onnx"] = whole.subarray(2000);
  for (const name of ["encoder.onnx", "weights.onnx"]) {
    const sha256 = createHash("sha256").update(files[name]!).digest("hex");
    manifest.files[name] = { sha256, size: files[name]!.length };
  }
  await assert.rejects(altered(JSON.stringify(manifest)), BundleError);
  graphs.encoder.weights = "weights.onnx";
  await altered(JSON.stringify(manifest));
  graphs.encoder.weights = "other.onnx";
  await assert.rejects(altered(JSON.stringify(manifest)), /"other.onnx" is not in the manifest/);
  graphs.encoder.weights = 3;
  await assert.rejects(altered(JSON.stringify(manifest)), /graphs.encoder.weights: is no text/);
});

test("bundles of another format, and manifests of another form, are refused", async () => {
  const { manifest, altered } = await unpacked("predict");
  await altered(JSON.stringify(manifest));
  await assert.rejects(altered(JSON.stringify({ ...manifest, format: 2 })), /format 2; format 3 is read/);
  for (const text of [
    "",
    "no JSON",
    "null",
    "[]",
    '{"format": 3}',
    JSON.stringify({ ...manifest, loop: "other" }),
  ]) {
    await assert.rejects(altered(text), BundleError, text.slice(0, 20));
  }
  for (const name of ["files", "graphs", "motion", "defaults", "loop"]) {
    for (const value of [undefined, null, 3, "x", []]) {
      await assert.rejects(
        altered(JSON.stringify({ ...manifest, [name]: value })),
        BundleError,
        `${name}: ${value}`,
      );
    }
  }
});

test("bundles that are not there, or of another kind, are refused", async () => {
  await assert.rejects(load("http://localhost:1/predict.zip"), /BundleError: http:.*cannot be fetched/);
  await assert.rejects(load(await bundle("predict"), FillModel), /for predict: it is no FillModel/);
});

/** A field of a protocol buffer: bytes, or a number. */
function field(number: number, value: Uint8Array | string | number): number[] {
  const tag = number * 8 + (typeof value === "number" ? 0 : 2);
  const start = tag < 128 ? [tag] : [(tag & 127) | 128, tag >> 7];
  if (typeof value === "number") return [...start, value];
  const data = typeof value === "string" ? new TextEncoder().encode(value) : value;
  return [...start, data.length, ...data];
}

test("graphs that reach outside, or may never end, are refused", () => {
  const model = (...graph: number[][]) => Uint8Array.from(field(7, Uint8Array.from(graph.flat())));
  const node = (...fields: number[][]) => field(1, Uint8Array.from(fields.flat()));
  checkGraph(model(node(field(4, "Add"))));
  const tensor = (...fields: number[][]) => field(5, Uint8Array.from(fields.flat()));
  assert.throws(() => checkGraph(model(node(field(4, "Loop")))), /may never end/);
  assert.throws(() => checkGraph(model(node(field(7, "com.microsoft")))), /not ONNX's own/);
  assert.throws(() => checkGraph(model(tensor(field(13, "weights.bin")))), /in another file/);
  assert.throws(() => checkGraph(model(tensor(field(14, 1)))), /in another file/);
  assert.throws(() => checkGraph(Uint8Array.from(field(25, "f"))), /unknown field 25/);
  assert.throws(() => checkGraph(new TextEncoder().encode("0000ORTM")), /cannot be checked/);
  assert.throws(() => checkGraph(Uint8Array.from([58, 9, 1])), /truncated/);
});

test("sentences and frames that a model cannot read are refused", async () => {
  const search = (await load(await bundle("search"))) as SearchModel;
  for (const text of ["", "...", "xyzzy qwrt", "walk ".repeat(41), "a".repeat(2001)]) {
    await assert.rejects(search.embedText(text), TextError, `${text.slice(0, 20)} is refused`);
  }
  assert.equal(
    search.vocabulary.decode(search.vocabulary.encode("Walks one hundred and five steps, wlaks!").ids),
    "walks 105 steps walks",
  );
  const generate = (await load(await bundle("generate"))) as GenerateModel;
  for (const settings of [
    { seconds: 0 },
    { seconds: -1 },
    { seconds: NaN },
    { temperature: 0 },
    { seed: 1.5 },
    { hypotheses: 0 },
  ]) {
    await assert.rejects(generate.generate("walk", settings), DecodingError, JSON.stringify(settings));
  }
  const predict = (await load(await bundle("predict"))) as PredictModel;
  for (const frames of [[], [[1, 2]], Array(10).fill(Array(69).fill(NaN))]) {
    await assert.rejects(predict.predict(frames), DecodingError);
  }
  for (const count of [0, 2.5, Infinity])
    await assert.rejects(predict.predict(Array(10).fill(Array(69).fill(0)), count), DecodingError);
});

test("noise is numpy's: default_rng(seed).random(3, float32), and what it spawns", () => {
  const near = (found: number[], wanted: number[]) =>
    found.forEach((value, at) => assert.ok(Math.abs(value - wanted[at]!) < 1e-7));
  near(new Pcg64(0).uniform(5), [0.8506242, 0.63696164, 0.5111365, 0.26978666, 0.30782938]);
  near(new Pcg64(12345678901).uniform(3), [0.0879392, 0.8361378, 0.7384326]);
  near(new Pcg64(7, 0).uniform(3), [0.30536908, 0.79785913, 0.2038976]);
  near(new Pcg64(7, 2).uniform(3), [0.3966366, 0.6320442, 0.7854183]);
});

const WRONG: Record<string, [string, (manifest: any) => void, RegExp]> = {
  "no shape": ["predict", (m) => delete m.graphs.step.inputs[0].shape, /graphs\.step\.inputs\.0\.shape/],
  "a shape of lists": [
    "predict",
    (m) => (m.graphs.step.inputs[0].shape = [[1], 2]),
    /graphs\.step\.inputs\.0\.shape/,
  ],
  "a size of 2 ** 40": [
    "predict",
    (m) => (m.graphs.step.inputs[0].shape = [2 ** 40]),
    /graphs\.step\.inputs\.0\.shape/,
  ],
  "no inputs": ["predict", (m) => (m.graphs.encoder.inputs = []), /graphs\.encoder\.inputs/],
  "another type of tensors": [
    "predict",
    (m) => (m.graphs.step.inputs[0].dtype = "string"),
    /needs a name and a dtype/,
  ],
  "a state from nowhere": ["predict", (m) => (m.graphs.step.feedback.none = "nothing"), /feedback\.none/],
  "a start of words": ["predict", (m) => (m.graphs.step.start = { state: ["x"] }), /start\.state/],
  "no deviation": ["predict", (m) => (m.motion.std[0] = 0), /motion\.std/],
  "a mean of text": ["predict", (m) => (m.motion.mean[0] = "x"), /motion\.mean/],
  "a rate of 10^6": ["predict", (m) => (m.motion.fps = 1e6), /motion\.fps/],
  "a joint below itself": [
    "predict",
    (m) => (m.motion.skeleton.joints[1].parent = 1),
    /motion\.skeleton\.joints\.1/,
  ],
  "a table of half rows": [
    "control",
    (m) => (Object.values<any>(m.tables)[0].shape = [1.5]),
    /tables\..*shape/,
  ],
  "a file of no size": ["predict", (m) => (m.files["golden.npz"].size = "x"), /files\.golden\.npz/],
  "words that are numbers": ["generate", (m) => (m.vocabulary[5] = 7), /vocabulary/],
  "actions without words": ["generate", (m) => delete m.actions[0].words, /actions/],
  "a decoder that looks 1,000 steps ahead": [
    "generate",
    (m) => (m.config.codec.ahead[0] = 1000),
    /what its decoder looks at/,
  ],
  "no codec": ["generate", (m) => delete m.config.codec, /what its decoder looks at/],
  "a setting without end": [
    "generate",
    (m) => (m.settings.continuation.context = 1e12),
    /settings\.continuation\.context/,
  ],
};
for (const [fault, [name, change, place]] of Object.entries(WRONG)) {
  test(`a manifest with ${fault} is refused with its place`, async () => {
    const { manifest, altered } = await unpacked(name);
    change(manifest);
    await assert.rejects(
      altered(JSON.stringify(manifest)),
      (error: unknown) => error instanceof BundleError && place.test(error.message),
    );
  });
}

test("what ONNX Runtime throws while it computes is a BundleError, and a model that was released computes no more", async () => {
  const model = (await load(await bundle("search"))) as SearchModel;
  const frames = Array.from({ length: 30 }, () => model.manifest.motion.mean);
  await model.embedMotion(frames);
  await release(model);
  await assert.rejects(
    model.embedMotion(frames),
    (error: unknown) => error instanceof BundleError && /cannot compute it/.test(error.message),
  );
});

test("in Node a bundle is loaded by its path, and one that is not there is named", async () => {
  assert.equal((await load("../motet/bundles/predict.zip")).manifest.name, "predict");
  await assert.rejects(
    load("../motet/bundles/none.zip"),
    (error: unknown) => error instanceof BundleError && /none\.zip cannot be read/.test(error.message),
  );
});
