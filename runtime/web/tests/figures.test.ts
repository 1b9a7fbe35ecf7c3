/* Figures and frames are those that Python gives: tests/runtime/web_cases.py writes the cases. */
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import test from "node:test";
import {
  Bundle,
  clipsOf,
  framesFor,
  fromHumanoid,
  isHumanoid,
  type Motion,
  motionOf,
  plantFeet,
  readBVH,
  readGLB,
  toBVH,
  toHumanoid,
  toVRMA,
  worldOf,
} from "../src/index.js";
import { cut } from "../src/motion/motion.js";
import { bundle } from "./bundles.js";
import { TABLES } from "../src/figures/humanoid/tables.js";

interface Case {
  text?: string;
  convention: string;
  confidence: number;
  unit: number;
  places: number[][][];
  back?: number[][][];
}

const cases = JSON.parse(readFileSync("tests/cases.json", "utf8")) as {
  figures: Record<string, Case>;
  frames: Record<string, { frames: number[][]; places: number[][][] }>;
  scenes: Record<
    string,
    { base64: string; joints: string[]; fps: number; own: number[][][]; places: number[][][] }
  >;
  feet: { frames: number[][]; held: number[][]; places: number[][][] };
};
const manifestOf = async (name: string) => (await Bundle.open(await bundle(name))).manifest;

function near(found: unknown, wanted: unknown, within = 1e-4, what = ""): void {
  const own = [found].flat(4) as number[];
  const other = [wanted].flat(4) as number[];
  assert.equal(own.length, other.length, what);
  const off = own.map((value, at) => Math.abs(value - other[at]!));
  const worst = off.indexOf(Math.max(...off));
  assert.ok(off[worst]! <= within, `${what}: ${own[worst]}, not ${other[worst]} at ${worst}`);
}

const every = (motion: Motion, step: number) => worldOf(motion).places.filter((_, at) => at % step === 0);

for (const [name, { text, convention, confidence, unit, places, back }] of Object.entries(cases.figures)) {
  test(`the figure ${name} comes to the humanoid as in Python`, () => {
    const motion = readBVH(text ?? readFileSync(`../../tests/runtime/skeletons/${name}.bvh`));
    const found = toHumanoid(motion);
    assert.deepEqual([found.convention, found.confidence, found.unit], [convention, confidence, unit]);
    near(every(found.motion, text ? 4 : 1), places, 1e-4, "places");
    const first = cut(found.motion, 0, 4);
    // lengths are in the figure's unit
    if (back) near(every(fromHumanoid(first, motion), 1), back, 1e-4 / unit, "back");
    if (back)
      near(every(fromHumanoid(first, found.figure), 1), back, 1e-4 / unit, "back onto what was measured");
  });
}

for (const [name, { base64, joints, fps, own, places }] of Object.entries(cases.scenes)) {
  test(`${name} is read as in Python, and comes to the humanoid`, () => {
    const content = new Uint8Array(Buffer.from(base64, "base64"));
    assert.equal(clipsOf(content)[0], "motion");
    const motion = readGLB(content);
    assert.deepEqual([motion.skeleton.names, motion.fps], [joints, fps]);
    near(every(motion, 5), own, 1e-5, "its own joints");
    near(every(toHumanoid(motion).motion, 5), places, 1e-4, "places");
  });
}

test("all tables of names are there, in the order of their files", () => {
  const files = readdirSync("../motet/figures/humanoid/conventions").sort();
  const titles = files.map(
    (file) => JSON.parse(readFileSync(`../motet/figures/humanoid/conventions/${file}`, "utf8")).title,
  );
  assert.deepEqual(
    TABLES.map((table) => table.title),
    titles,
  );
});

for (const name of ["describe", "predict", "generate"]) {
  test(`a dropped file becomes the frames of ${name} as in Python, and comes back`, async () => {
    const manifest = await manifestOf(name);
    const frames = framesFor(readBVH(cases.figures.walk!.text!), manifest);
    near(frames, cases.frames[name]!.frames, 2e-3 / manifest.motion.fps, "frames");
    near(every(motionOf(frames, manifest, { plant: false }), 8), cases.frames[name]!.places, 1e-4, "places");
  });
}

test("feet are held as in Python", async () => {
  const manifest = await manifestOf("generate");
  const { frames, held, places } = cases.feet;
  near(plantFeet(frames, manifest), held, 1e-3, "frames");
  near(every(motionOf(frames, manifest), 8), places, 1e-4, "places");
});

test("BVH that is written is read again, with the same positions; Python reads it, too", () => {
  const { motion } = toHumanoid(readBVH(cases.figures.walk!.text!));
  const text = toBVH(motion);
  near(worldOf(toHumanoid(readBVH(text)).motion).places, worldOf(motion).places, 1e-6);
  const words = (content: string) =>
    content.split(/\s+/).map((word) => (Number.isNaN(Number(word)) ? word : Number(word)));
  const own = words(text);
  const wanted = words(readFileSync("tests/written/walk.bvh", "utf8"));
  assert.deepEqual(
    own.filter((word) => typeof word === "string"),
    wanted.filter((word) => typeof word === "string"),
  );
  near(
    own.filter((word) => typeof word === "number"),
    wanted.filter((word) => typeof word === "number"),
    1e-5,
  );
});

test("VRMA is written as the file that Python reads", () => {
  const { motion } = toHumanoid(readBVH(cases.figures.walk!.text!));
  assert.ok(isHumanoid(motion.skeleton));
  const parts = (file: Uint8Array) => {
    const data = Uint8Array.from(file); // aligned
    const length = new DataView(data.buffer).getUint32(12, true);
    return {
      json: new TextDecoder().decode(data.subarray(20, 20 + length)),
      numbers: Array.from(new Float32Array(data.buffer, 28 + length)),
    };
  };
  const own = parts(toVRMA(motion));
  const wanted = parts(readFileSync("tests/written/walk.vrma"));
  assert.equal(own.json, wanted.json);
  near(own.numbers, wanted.numbers, 1e-6);
});
