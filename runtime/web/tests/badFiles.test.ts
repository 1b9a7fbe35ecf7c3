/* Files that are no motions, are cut short or hold no human, are refused by name. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { FormatError, fromHumanoid, holdFeet, MotionError, readBVH, Skeleton, toHumanoid } from "../src/index.js";

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
    [mixamo.replace(/OFFSET .*/, "OFFSET 1 2"), /line \d+: expected three numbers/],
    [mixamo.replace(/OFFSET .*/, "OFFSET 1 2 nan"), /line \d+: "nan" is not a finite number/],
    [mixamo.replace("Zrotation", "Wrotation"), /channel "Wrotation"/],
    [mixamo.replace("CHANNELS 6", "CHANNELS 600000"), /CHANNELS needs a count/],
    [mixamo.replace("}", ""), /does not belong|MOTION is missing/],
    [Uint8Array.from([66, 86, 72, 0, 1]), /not a text file/],
  ];
  for (const [content, reason] of wrong) assert.throws(() => readBVH(content), (error) => error instanceof FormatError && reason.test(error.message), String(reason));
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
  assert.throws(() => read(mixamo.replaceAll(/(JOINT|ROOT) \S+/g, (_, kind) => `${kind} x`)), /give a map of bones and joints/);
  assert.throws(() => read(mixamo.replaceAll("LeftFoot", "LeftSole").replaceAll("LeftToe", "LeftTip")), /no joint was found for leftFoot.*one side/);
  assert.throws(() => read(mixamo.replaceAll(/OFFSET .*/g, "OFFSET 0 0 0")), /length zero/);
  const large = readBVH(mixamo);
  const skeleton = new Skeleton(large.skeleton.joints, 1);
  assert.throws(() => toHumanoid({ ...large, skeleton }), /legs of .* m: a human's are 0.2 to 1.6 m/);
  assert.throws(() => toHumanoid({ ...large, rotations: [], translations: [] }), /no frames/);
  assert.throws(() => toHumanoid({ ...large, fps: NaN }), /frame rate/);
  assert.throws(() => toHumanoid(large, { hips: "Nobody" }), /no joint "Nobody"/);
  assert.throws(() => toHumanoid(large, { tail: "mixamorig:Hips" }), /"tail" is not a bone/);
  for (const wrong of [() => fromHumanoid(large, large), () => holdFeet(large)]) assert.throws(wrong, MotionError);
});

test("a map names joints that no table knows", () => {
  const { joints, spine, neck } = toHumanoid(readBVH(mixamo)).figure.fitted.body.map;
  const renamed = readBVH(mixamo.replaceAll(/(JOINT|ROOT) (\S+)/g, (_, kind, name) => `${kind} q${name.replace("mixamorig:", "")}q`));
  const name = (at: number) => renamed.skeleton.names[at]!;
  const map = { ...Object.fromEntries(Object.entries(joints).map(([bone, at]) => [bone, name(at)])), spine: spine.map(name), neck: neck.map(name) };
  assert.deepEqual(toHumanoid(renamed, map).motion.rotations, toHumanoid(readBVH(mixamo)).motion.rotations);
});
