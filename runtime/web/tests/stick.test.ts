import assert from "node:assert/strict";
import test from "node:test";
import { stick } from "../src/live/stick.js";

const PACES = { least: 0.1, walk: 1.28, run: 2.47 };

test("a stick creeps from the dead zone on, walks and runs, and never slows down as it is pushed further", () => {
  assert.deepEqual(stick(0.149, true, PACES), { speed: 0, runs: false });
  assert.deepEqual(stick(NaN, true, PACES), { speed: 0, runs: false });
  const asked = Array.from({ length: 86 }, (_, n) => stick(0.15 + n / 100, false, PACES));
  const speeds = asked.map(({ speed }) => speed);
  assert.ok(
    Math.abs(speeds[0]! - 0.1) < 1e-9 &&
      Math.abs(speeds[55]! - 1.28) < 1e-9 &&
      Math.abs(speeds[85]! - 2.47) < 1e-9,
  );
  speeds.slice(1).forEach((speed, n) => assert.ok(speed > speeds[n]! && speed - speeds[n]! < 0.05));
  asked.forEach(({ speed, runs }) => assert.equal(runs, speed > 1.95));
});

test("a run ends lower than it begins", () => {
  const push = 0.82; // 1.76 m/s
  assert.deepEqual(
    [false, true].map((runs) => stick(push, runs, PACES).runs),
    [false, true],
  );
  assert.equal(stick(0.77, true, PACES).runs, false); // 1.56 m/s
});
