/* Clips in place are found and given a path as in Python, which wrote the cases: tests/runtime/test_web.py. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import {
  Bundle,
  framesFor,
  HUMANOID,
  isInPlace,
  type Motion,
  MotionError,
  readBVH,
  resampled,
  withTravel,
} from "../src/index.js";
import { humanoidMotion } from "../src/figures/humanoid/bones.js";
import { cut } from "../src/motion/motion.js";
import { about, type Quaternion, type Vector, X } from "../src/motion/rotations.js";
import { bundle } from "./bundles.js";
import { close, equal } from "./cases.js";
import python from "./python.json";

const { figures } = JSON.parse(readFileSync("tests/cases.json", "utf8")) as {
  figures: Record<string, { text: string }>;
};

/** The motion with its root over the origin, along two of its axes. */
function inPlace(motion: Motion, up: number): Motion {
  const still = (place: Vector) => place.map((value, axis) => (axis === up ? value : 0)) as Vector;
  return {
    ...motion,
    translations: motion.translations.map(([root, ...others]) => [still(root!), ...others]),
  };
}

for (const [name, { inPlace: found, path, root }] of Object.entries(python.travel)) {
  const [figure, fps] = name.split(", ") as [string, string];
  const motion = resampled(readBVH(figures[figure]!.text), Number(fps));
  const still = inPlace(motion, figure === "z up" ? 2 : 1);
  test(`${name} frames a second, in place, gets the path that its feet imply, as in Python`, async (context) => {
    equal([isInPlace(motion), isInPlace(still)], found, "in place");
    close(
      withTravel(still)
        .translations.filter((_, at) => at % 4 === 0)
        .flatMap((moves) => moves[0]!),
      path.flat(),
      "path",
    );
    const { manifest } = await Bundle.open(await bundle("describe"));
    const { mock } = context.mock.method(console, "warn", () => {});
    close(
      framesFor(still, manifest).flatMap((frame) => frame.slice(0, 6)),
      root.flat(),
      "frames",
    );
    framesFor(motion, manifest);
    assert.deepEqual(
      mock.calls.map((call) => call.arguments),
      [["the feet stride while the root stays: models take it with the path that the feet imply"]],
    );
  });
}

/** A figure that steps on the spot for 4 s; its feet go back by so many degrees of the thigh while they stand. */
function stepping(slides: number): Motion {
  const rotations = Array.from({ length: 120 }, (_, frame) => {
    const own = HUMANOID.joints.map((): Quaternion => [0, 0, 0, 1]);
    for (const [side, phase] of [
      ["left", 0],
      ["right", Math.PI],
    ] as const) {
      const angle = (2 * Math.PI * frame) / 30 + phase;
      const swung = slides * Math.sin(angle);
      const lifted = Math.max(0, Math.cos(angle));
      const turns = { UpperLeg: -swung - 40 * lifted, LowerLeg: 80 * lifted, Foot: swung - 40 * lifted };
      for (const [part, degrees] of Object.entries(turns))
        own[HUMANOID.index(side + part)] = about(X, (degrees * Math.PI) / 180);
    }
    return own;
  });
  const hips = rotations.map((): Vector => [0, 0.93, 0]);
  return humanoidMotion(rotations, hips, 30);
}

test("steps on the spot are no clip in place, but with legs that swing they are", () => {
  assert.deepEqual([isInPlace(stepping(0)), isInPlace(stepping(20))], [false, true]);
});

test("what says too little is left: no path, a few frames, no human", () => {
  const still = stepping(20);
  assert.ok(!isInPlace({ ...still, travels: false }));
  for (const count of [1, 2, 3]) assert.ok(!isInPlace(cut(still, 0, count)));
  assert.equal(withTravel(cut(still, 0, 1)).rotations.length, 1);
  const stick = readBVH(
    "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 3\nFrame Time: 0.1\n0 0 0\n0 0 0\n0 0 0\n",
  );
  assert.ok(!isInPlace(stick));
  assert.throws(() => withTravel(stick), MotionError);
});
