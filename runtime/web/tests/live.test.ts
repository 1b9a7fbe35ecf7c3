/* What sentences ask a figure of the page for, and what it saves. */
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import type { Net } from "../src/live/crowd.js";
import type { Figure } from "../src/live/figure.js";
import { toGIF } from "../src/live/gif.js";
import { orderOf, Phrases, saysAll } from "../src/live/words.js";

const net = {
  gaits: ["walk", "run", "jump"],
  speeds: { walk: [0.7, 1.3, 1.9], run: [1.8, 3, 4], jump: [0, 0, 2] },
} as unknown as Net;
const figure = { wanted: { gait: 0, x: 0, z: 1.2, facing: 0 }, root: [0, 0, 0] } as unknown as Figure;
const order = (text: string) => {
  const found = orderOf(text, net, figure);
  return found && [found.gait, Math.round(100 * found.speed) / 100, Math.round((found.way * 180) / Math.PI)];
};

test("orders are read from what is typed", () => {
  assert.deepEqual(order("A person walks forward."), [0, 1.3, 0]);
  assert.deepEqual(order("run"), [1, 3, 0]);
  assert.deepEqual(order("everyone, please stop!"), [0, 0, 0]);
  assert.deepEqual(order("turn left"), [0, 1.2, 90]);
  assert.deepEqual(order("turn right 45 degrees and run"), [1, 3, -45]);
  assert.deepEqual(order("turn around"), [0, 1.2, 180]);
  assert.deepEqual(order("slower"), [0, 0.84, 0]);
  for (const other of ["turn", "kick", "run and kick", "jump", "", "...", "a person", "12"])
    assert.equal(order(other), null, other);
  assert.ok(saysAll("Everybody wave") && !saysAll("wave"));
});

const { acts } = JSON.parse(await readFile("../motet/live/repertoire.json", "utf8")) as {
  acts: { sentence: string; words: string[] }[];
};
const phrases = new Phrases(acts);

test("sentences find the acts that are said so, and nothing else", () => {
  const found = (text: string) => acts[phrases.find(text).at]?.sentence ?? "?";
  const wanted = {
    wave: "waves vehicles",
    kick: "kick",
    "sit down": "takes a seat",
    bow: "bows",
    "do a cartwheel": "cartwheel",
    jump: "jump",
    "a person is boxing": "box",
    "drink something": "drink",
    "dance, please": "danc",
    "laugh out loud": "laugh",
    kik: "kick",
    "kick with the left leg": "left",
    "punch with the right hand": "right",
    crouch: "crouch",
  };
  for (const [text, part] of Object.entries(wanted))
    assert.ok(found(text).includes(part), `${text}: ${found(text)}`);
  assert.deepEqual(phrases.find("wave").lacking, []);
  assert.deepEqual(phrases.find("kick the ball with the left leg").lacking, ["left"]);
  for (const text of ["play the violin", "fly to the moon", "", "the a of", "paint a house"])
    assert.equal(found(text), "?", text);
});

test("a GIF has its size and its pictures", () => {
  const picture = (shade: number) =>
    Uint8ClampedArray.from({ length: 4 * 16 * 9 }, (_, at) => (at % 4 === 3 ? 255 : (at * shade) % 256));
  const bytes = toGIF([picture(1), picture(7), picture(7)], 16, 9, 10);
  assert.equal(new TextDecoder().decode(bytes.subarray(0, 6)), "GIF89a");
  assert.deepEqual([...bytes.subarray(6, 10)], [16, 0, 9, 0]);
  assert.equal(bytes.at(-1), 0x3b);
});
