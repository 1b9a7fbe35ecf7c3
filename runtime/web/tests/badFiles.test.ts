/* Files that are no motions, are cut short or hold no human, are refused by name. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import {
  clipsOf,
  FormatError,
  fromHumanoid,
  holdFeet,
  MotionError,
  readBVH,
  readGLB,
  Skeleton,
  toHumanoid,
} from "../src/index.js";
import { rateOf } from "../src/formats/gltf.js";

const mixamo = readFileSync("../../tests/runtime/skeletons/mixamo.bvh", "utf8");

test("BVH texts that are wrong are refused with the line", () => {
  const wrong: [string | Uint8Array, RegExp][] = [
    ["", /MOTION is missing/],
    ["no motion", /line 1: "no motion" does not belong here/],
    [mixamo.slice(0, 500), /MOTION is missing|does not belong|channel|OFFSET|number/i],
    [mixamo.slice(0, mixamo.indexOf("Frames:")), /cut short/],
    [mixamo.slice(0, -200), /whole frames|declares/],
    [mixamo.replace(/Frames: *\d+/, "Frames: 900000000"), /declares 900000000 frames but holds/],
    [mixamo.replace(/Frame Time: *\S+/, "Frame Time: 0"), /out of range/],
    [mixamo.replace(/Frame Time: *\S+/, "Frame Time: 0.000005"), /out of range/],
    [mixamo.replace(/OFFSET .*/, "OFFSET 1 2"), /line \d+: expected three numbers/],
    [mixamo.replace(/OFFSET .*/, "OFFSET 1 2 nan"), /line \d+: "nan" is not a finite number/],
    [mixamo.replace("Zrotation", "Wrotation"), /channel "Wrotation"/],
    [mixamo.replace("CHANNELS 6", "CHANNELS 600000"), /CHANNELS needs a count/],
    [mixamo.replace("}", ""), /does not belong|MOTION is missing/],
    [Uint8Array.from([66, 86, 72, 0, 1]), /not a text file/],
  ];
  for (const [content, reason] of wrong)
    assert.throws(
      () => readBVH(content),
      (error) => error instanceof FormatError && reason.test(error.message),
      String(reason),
    );
});

test("files cut short at any place are refused or read, but nothing else is thrown", () => {
  for (let end = 0; end < mixamo.length; end += 97) {
    try {
      readBVH(mixamo.slice(0, end));
    } catch (error) {
      assert.ok(error instanceof FormatError, String(error));
    }
  }
});

test("figures that are no human's are refused with the reason", () => {
  const read = (text: string) => toHumanoid(readBVH(text));
  assert.throws(
    () => read(mixamo.replaceAll(/(JOINT|ROOT) \S+/g, (_, kind) => `${kind} x`)),
    /give a map of bones and joints/,
  );
  assert.throws(
    () => read(mixamo.replaceAll("LeftFoot", "LeftSole").replaceAll("LeftToe", "LeftTip")),
    /no joint was found for leftFoot.*one side/,
  );
  assert.throws(() => read(mixamo.replaceAll(/OFFSET .*/g, "OFFSET 0 0 0")), /length zero/);
  const large = readBVH(mixamo);
  const skeleton = new Skeleton(large.skeleton.joints, 1);
  assert.throws(() => toHumanoid({ ...large, skeleton }), /legs of .* m: a human's are 0.2 to 1.6 m/);
  assert.throws(() => toHumanoid({ ...large, rotations: [], translations: [] }), /no frames/);
  assert.throws(() => toHumanoid({ ...large, fps: NaN }), /frame rate/);
  assert.throws(() => toHumanoid(large, { hips: "Nobody" }), /no joint "Nobody"/);
  assert.throws(() => toHumanoid(large, { tail: "mixamorig:Hips" }), /"tail" is not a bone/);
  for (const wrong of [() => fromHumanoid(large, large), () => holdFeet(large)])
    assert.throws(wrong, MotionError);
});

test("a map names joints that no table knows", () => {
  const { joints, spine, neck } = toHumanoid(readBVH(mixamo)).figure.fitted.body.map;
  const renamed = readBVH(
    mixamo.replaceAll(
      /(JOINT|ROOT) (\S+)/g,
      (_, kind, name) => `${kind} q${name.replace("mixamorig:", "")}q`,
    ),
  );
  const name = (at: number) => renamed.skeleton.names[at]!;
  const map = {
    ...Object.fromEntries(Object.entries(joints).map(([bone, at]) => [bone, name(at)])),
    spine: spine.map(name),
    neck: neck.map(name),
  };
  assert.deepEqual(toHumanoid(renamed, map).motion.rotations, toHumanoid(readBVH(mixamo)).motion.rotations);
});

const { scenes } = JSON.parse(readFileSync("tests/cases.json", "utf8"));
const avatar = new Uint8Array(Buffer.from(scenes["avatar.vrm"].base64, "base64"));

/** The avatar with another JSON object. */
function changed(change: (document: any) => void): Uint8Array {
  const length = new DataView(avatar.buffer).getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(avatar.subarray(20, 20 + length)));
  change(document);
  const json = new TextEncoder().encode(JSON.stringify(document));
  const file = new Uint8Array(20 + json.length + avatar.length - 20 - length);
  file.set(avatar.subarray(0, 20));
  new DataView(file.buffer).setUint32(12, json.length, true);
  file.set(json, 20);
  file.set(avatar.subarray(20 + length), 20 + json.length);
  return file;
}

/** The first track's values as zeros with all rows put in, at indices in a buffer of their own. */
function sparsely(document: any, changes: object = {}): void {
  const accessor = document.accessors[document.animations[0].samplers[0].output];
  const { bufferView, byteOffset = 0, count } = accessor;
  const indices = Buffer.from(Uint16Array.from({ length: count }, (_, at) => at).buffer);
  document.buffers.push({ byteLength: indices.length, uri: `data:;base64,${indices.toString("base64")}` });
  document.bufferViews.push({ buffer: document.buffers.length - 1, byteLength: indices.length });
  delete accessor.bufferView;
  delete accessor.byteOffset;
  const places = { bufferView: document.bufferViews.length - 1, componentType: 5123 };
  accessor.sparse = { count, indices: places, values: { bufferView, byteOffset }, ...changes };
}

test("sparse arrays of glTF are read as plain ones", () => {
  assert.deepEqual(readGLB(changed((document) => sparsely(document))), readGLB(avatar));
});

test("frame rates of keys are read as written", () => {
  for (const fps of [23.976, 24, 25, 29.97, 30, 59.94, 60, 119.88, 120]) {
    const times = Array.from({ length: 3000 }, (_, frame) => Math.fround(frame / fps));
    assert.equal(
      rateOf([times, times.filter((_, at) => at % 3 === 0), times.filter((_, at) => at % 7 !== 3)]),
      fps,
    );
  }
  assert.equal(rateOf([[0, 1], [5]]), 30);
});

test("glTF files that are wrong are refused by name", () => {
  const bones = (document: any) => document.extensions.VRMC_vrm.humanoid.humanBones;
  const wrong: [Uint8Array, RegExp][] = [
    [new Uint8Array(), /not a glTF file/],
    [new TextEncoder().encode("HIERARCHY"), /not a glTF file/],
    [new TextEncoder().encode("null"), /not a file of glTF 2.0/],
    [avatar.subarray(0, 15), /no JSON chunk/],
    [avatar.subarray(0, avatar.length - 100), /cut short/],
    [changed((d) => (d.asset.version = "1.0")), /not a file of glTF 2.0/],
    [
      changed((d) => {
        d.extensions = { VRMC_vrm: {} };
        d.skins = [];
        d.animations = [];
      }),
      /no skeleton: expected a skin with joints or a VRM humanoid/,
    ],
    [
      changed((d) => {
        for (const [bone] of Object.entries(bones(d))) bones(d)[bone] = { node: 1e9 };
      }),
      /joints that are not nodes/,
    ],
    [changed((d) => d.nodes[3].children.push(0)), /cycle|not a tree/],
    [changed((d) => (d.nodes = Array(30000).fill({}))), /30000 nodes/],
    [changed((d) => (d.accessors[d.animations[0].samplers[0].output].count = 2 ** 40)), /beyond its buffer/],
    [
      changed((d) => (d.accessors[d.animations[0].samplers[0].output].type = "VEC9")),
      /broken glTF file|beyond/,
    ],
    [changed((d) => (d.bufferViews = 7)), /broken glTF file/],
    [
      changed((d) => {
        const accessor = d.accessors[d.animations[0].samplers[0].output];
        delete accessor.bufferView;
        accessor.count = 2 ** 40;
      }),
      /its arrays overlap/,
    ],
    [changed((d) => sparsely(d, { count: 1e9 })), /beyond its buffer/],
    [changed((d) => sparsely(d, { count: -1 })), /beyond its buffer/],
    [
      changed((d) => sparsely(d, { indices: { bufferView: 0, componentType: 5126 } })),
      /sparse indices are not unsigned/,
    ],
    [
      changed((d) => sparsely(d, { indices: { bufferView: 0, componentType: 5125 } })),
      /sparse indices do not rise/,
    ],
    [changed((d) => sparsely(d, { indices: undefined })), /broken glTF file/],
    [changed((d) => (d.buffers[0].uri = "other.bin")), /is a file of its own/],
    [
      changed((d) => (d.bufferViews.at(-1).extensions = { EXT_meshopt_compression: {} })),
      /packed by meshoptimizer/,
    ],
  ];
  for (const [content, reason] of wrong) {
    assert.throws(
      () => readGLB(content),
      (error) => error instanceof FormatError && reason.test(error.message),
      String(reason),
    );
  }
  assert.throws(() => readGLB(avatar, "dance"), /no clip "dance"/);
  assert.throws(() => clipsOf(avatar.subarray(0, 40)), FormatError);
  const legless = readGLB(
    changed((d) => {
      for (const bone of Object.keys(bones(d))) if (/Leg|Foot|Toes/.test(bone)) delete bones(d)[bone];
    }),
  );
  assert.throws(
    () => toHumanoid(legless),
    (error) =>
      error instanceof MotionError && /no table|no joint was found for leftUpperLeg/.test(error.message),
  );
});

test("a glTF file of which any byte was altered is read or refused, but nothing else is thrown", () => {
  for (let at = 0; at < avatar.length; at += 53) {
    const altered = Uint8Array.from(avatar);
    altered[at]! ^= 0x15;
    try {
      readGLB(altered);
    } catch (error) {
      assert.ok(error instanceof FormatError, String(error));
    }
  }
});
