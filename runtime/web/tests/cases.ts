/* What every runtime has to give, in Node and in a browser: golden vectors, and answers that Python gave (python.json). */
import { type NumberArray, rows } from "../src/bundle/arrays.js";
import { Bundle, type TextTables } from "../src/bundle/bundle.js";
import {
  actOf,
  ControlModel,
  type ControlSession,
  DescribeModel,
  FillModel,
  GenerateModel,
  load,
  PredictModel,
  SearchModel,
  type Told,
  type Way,
} from "../src/index.js";
import { framesOf } from "../src/representation/poses.js";
import { Recorded } from "../src/decode/random.js";
import { Vocabulary } from "../src/text/vocabulary.js";
import python from "./python.json";

/** Reads the zip of a shipped bundle. */
export type Read = (name: string) => Promise<Uint8Array>;
export interface Case {
  name: string;
  /** Throws where an answer is not the wanted one. */
  run: (read: Read) => Promise<void>;
}

export function equal(found: unknown, wanted: unknown, what: string): void {
  const one = JSON.stringify(found);
  const other = JSON.stringify(wanted);
  if (one !== other) throw new Error(`${what}: ${one}, not ${other}`);
}

/** Within a ten-thousandth of the wanted numbers, as docs/reference/bundle.md compares them. */
export function close(found: ArrayLike<number>, given: ArrayLike<number | bigint>, what: string): void {
  const wanted = Array.from(given, Number);
  equal(found.length, wanted.length, `${what}, how many`);
  const size = Math.sqrt(wanted.reduce((sum, value) => sum + value ** 2, 0) / wanted.length);
  wanted.forEach((value, at) => {
    const off = Math.abs(found[at]! - value) / Math.max(1, size, Math.abs(value));
    if (!(off <= 1e-4)) throw new Error(`${what}: ${found[at]} at ${at}, not ${value}`);
  });
}

export const flat = (frames: ArrayLike<number>[]) => frames.flatMap((frame) => Array.from(frame));

async function loaded<T>(read: Read, name: string, kind: new (...given: never[]) => T) {
  const data = await read(name);
  const model = await load(data);
  if (!(model instanceof kind)) throw new Error(`${name} is no ${kind.name}`);
  const golden = await (await Bundle.open(data)).golden();
  const frames = (key: string) => rows(golden.get(`run.in.${key}`) as NumberArray<Float32Array>);
  const wanted = (key: string) => golden.get(`run.out.${key}`)!;
  return { model: model as T, frames, wanted, run: model.manifest.golden.run, golden };
}

const graphs = ["describe", "generate", "predict", "fill", "search"].map((name) => ({
  name: `graphs of ${name}`,
  run: async (read: Read) => {
    const bundle = await Bundle.open(await read(name));
    const golden = await bundle.golden();
    for (const [role, spec] of Object.entries(bundle.manifest.graphs)) {
      const inputs = Object.fromEntries(
        spec.inputs.map((input) => [input.name, golden.get(`${role}.in.${input.name}`)!]),
      );
      const outputs = await (await bundle.graph(role)).run(inputs);
      for (const output of spec.outputs)
        close(
          outputs[output.name]!.data,
          golden.get(`${role}.out.${output.name}`)!.data,
          `${role} ${output.name}`,
        );
    }
  },
}));

async function describe(read: Read): Promise<void> {
  const { model, frames, wanted } = await loaded(read, "describe", DescribeModel);
  const found = await model.hypotheses(frames("frames"));
  const { data, shape } = wanted("ids");
  const ids = found.map((one) => [...one.ids, ...Array<number>(shape[1]! - one.ids.length).fill(0)]);
  equal(ids.flat(), Array.from(data, Number), "ids");
  close(
    found.map((one) => one.logProbability),
    wanted("log_probabilities").data,
    "log-probabilities",
  );
}

async function generate(read: Read): Promise<void> {
  const { model, wanted, run, golden } = await loaded(read, "generate", GenerateModel);
  equal(model.vocabulary.encode(String(run.text)).ids, Array.from(wanted("ids").data, Number), "ids");
  const noise = new Recorded(
    rows(golden.get("run.in.uniform") as NumberArray<Float32Array>)[Symbol.iterator](),
  );
  const [best] = await model.drawn(String(run.text), Array(Number(run.hypotheses)).fill(noise), {
    seconds: Number(run.seconds),
  });
  const { mean, std } = model.manifest.motion;
  const normalised = best!.frames.map((frame) =>
    frame.map((value, at) => (std[at] ? Math.max(-50, Math.min(50, (value - mean[at]!) / std[at]!)) : 0)),
  );
  close(flat(normalised), wanted("frames").data, "frames");
}

async function predict(read: Read): Promise<void> {
  const { model, frames, wanted, run } = await loaded(read, "predict", PredictModel);
  close(flat(await model.predict(frames("frames"), Number(run.frames))), wanted("frames").data, "frames");
}

async function fill(read: Read): Promise<void> {
  const { model, frames, wanted, run } = await loaded(read, "fill", FillModel);
  close(
    flat(await model.fill(frames("past"), frames("after"), Number(run.frames))),
    wanted("filled").data,
    "filled",
  );
}

async function search(read: Read): Promise<void> {
  const { model, frames, wanted, run } = await loaded(read, "search", SearchModel);
  close(await model.embedMotion(frames("frames")), wanted("motion").data, "motion");
  const vector = await model.embedText(String(run.text));
  close(vector, wanted("text").data, "text");
  equal(
    model.nearest(vector, [await model.embedMotion(frames("frames")), vector], 1)[0]!.index,
    1,
    "nearest",
  );
}

/** Some of the frames, as python.json has them. */
function shown(
  frames: ArrayLike<number>[],
  wanted: { count: number; every: number; frames: number[][] },
  what: string,
): void {
  equal(frames.length, wanted.count, `${what}, how many frames`);
  close(flat(frames.filter((_, at) => at % wanted.every === 0)), wanted.frames.flat(), what);
}

async function seeds(read: Read): Promise<void> {
  const { model } = await loaded(read, "generate", GenerateModel);
  const [walk] = await model.generate("a person walks forward", { seed: 3, seconds: 2.5 });
  shown(walk!.frames, python.walk, "walk");
  const jumps = await model.generate("someone jumps twice", { seed: 11, hypotheses: 2 });
  jumps.forEach((one, at) => shown(one.frames, python.jumps[at]!, `jump ${at}`));
  shown(
    (await model.story("a person runs", { after: walk!.frames, seed: 2, seconds: 1.5 })).frames,
    python.after,
    "after",
  );
  for (const [text, parts] of Object.entries(python.parts)) equal(await model.parts(text), parts, text);
  for (const { text, confidence, ...rest } of python.understood) {
    const { confidence: found, ...other } = await model.understood(text);
    equal(other, { confident: rest.confident, nearest: rest.nearest }, text);
    close([found], [confidence], text);
  }
}

/** The actions that are shown, and what of a text they lack. */
async function taken(read: Read): Promise<void> {
  const { model } = await loaded(read, "generate", GenerateModel);
  const { warn } = console;
  const said: string[] = [];
  console.warn = (text: string) => said.push(text);
  try {
    for (const [text, wanted] of Object.entries(python.taken)) {
      const found = await model.generate(text, { hypotheses: 2, seed: 1, seconds: 1 });
      const own = found.flatMap((one) => [one, ...("passages" in one ? one.passages : [])]);
      equal(
        own.map(({ action, lacking }) => [action, lacking]),
        wanted.map(([action, lacking]) => [action, lacking]),
        text,
      );
      close(
        own.map((one) => one.confidence),
        wanted.map((one) => one[2]),
        text,
      );
      const refused = await model.generate(text, { seconds: 1, strict: true }).then(() => "", String);
      equal(
        refused.includes(", which leaves out '"),
        own.some((one) => one.lacking.length > 0),
        `${text}: ${refused}`,
      );
    }
  } finally {
    console.warn = warn;
  }
  equal([...new Set(said)].sort(), python.lacking, "warnings");
}

async function story(read: Read): Promise<void> {
  const { model } = await loaded(read, "generate", GenerateModel);
  const texts = ["a person walks forward", "someone waves"];
  const settings = { seed: 5, seconds: [1.3, null], stand: "both" as const };
  const { frames, passages } = await model.story(texts, settings);
  shown(frames, python.story, "story");
  equal(
    passages.map(({ text }) => text),
    python.story.passages.map(({ text }) => text),
    "passages",
  );
  close(
    passages.flatMap(({ start, stop }) => [start, stop]),
    python.story.passages.flatMap(({ start, stop }) => [start, stop]),
    "passages",
  );
  const pieces: Float32Array[][] = [];
  for await (const piece of model.stream(texts, settings)) pieces.push(piece);
  if (pieces.length < 10) throw new Error(`a stream of ${pieces.length} pieces`);
  equal(
    pieces.flat().map((frame) => [...frame]),
    frames.map((frame) => [...frame]),
    "stream",
  );
}

async function agreed(read: Read): Promise<void> {
  const { model, frames } = await loaded(read, "describe", DescribeModel);
  const found = await model.describe(frames("frames"), { draws: 60, seed: 4 });
  equal(
    found.map(({ text }) => text),
    python.draws.map(({ text }) => text),
    "texts",
  );
  close(
    found.flatMap((one) => [one.logProbability, one.score]),
    python.draws.flatMap((one) => [one.logProbability, one.score]),
    "scores",
  );
  close([await model.score(frames("frames"), "a person walks")], [python.score], "score");
  for (const [at, wanted] of python.answered.entries()) {
    const given = at ? frames("frames").slice(0, 4) : frames("frames"); // too short to be told
    const told = (await model.describe(given, { beams: 3 })).map(({ text, score, confident }) => ({
      text,
      score,
      confident,
    }));
    equal(
      told.map(({ text, confident }) => [text, confident]),
      wanted.map(({ text, confident }) => [text, confident]),
      "answers",
    );
    close(
      told.map(({ score }) => score),
      wanted.map(({ score }) => score),
      "probabilities",
    );
  }
}

/** A walk that is played backwards. */
async function backwards(read: Read): Promise<void> {
  const { model } = await loaded(read, "describe", DescribeModel);
  const { frames, text } = python.backwards;
  equal(
    (
      await model.describe(
        frames.map((row) => Float32Array.from(row)),
        { beams: 1 },
      )
    )[0]!.text,
    text,
    "text",
  );
}

async function expected(read: Read): Promise<void> {
  const { model, frames } = await loaded(read, "predict", PredictModel);
  close(
    await model.expectedErrors(frames("frames")),
    python.expected.map((metres) => 100 * metres),
    "centimetres",
  );
}

async function long(read: Read): Promise<void> {
  const { model, frames } = await loaded(read, "search", SearchModel);
  const many = Array(8)
    .fill(frames("frames"))
    .flat()
    .slice(0, 25 * model.fps + 1);
  close(await model.embedMotion(many), python.long, "vector");
}

/** The golden run of the bundle: targets in, frames out. */
async function steersTargets(read: Read): Promise<void> {
  const { model, frames, wanted } = await loaded(read, "control", ControlModel);
  const session = model.start({ holdFeet: false });
  const poses = frames("track").map(([x, z, facing]) => session.tickTo([[x!, z!, facing!]])[0]!);
  close(flat(framesOf(poses, model.fps)), wanted("frames").data, "frames");
}

/** Heights of the ground, as test_web.py has them. */
const GROUNDS = {
  stairs: (_: number, z: number) => 0.17 * Math.min(Math.max(Math.floor((z - 2.3) / 0.29), 0), 8),
  hills: (x: number, z: number) => 0.3 * Math.sin(0.7 * x) + 0.02 * z * z,
  ridges: (_: number, z: number) => 0.15 * Math.sin(6 * z),
};

type Some = { ids?: number[]; upper?: boolean };
type Go = Way & { points: number[][] | null };
type Points = { points: number[] | number[][] | null };
type Call = {
  put?: number[][];
  push?: number[];
  control?: Told;
  look_at?: Some & Points;
  reach?: Some & Points & { hand: "left" | "right" };
  keep_apart?: number | null;
  go_to?: Go;
  go_along?: Go;
  set_ground?: keyof typeof GROUNDS | null;
};
type Acts = Record<string, Parameters<ControlSession["act"]>[0]>;

/** Let a session do what is called by name. */
function obey(session: ControlSession, calls: Call, acts: Acts): void {
  const { put, push, control, keep_apart, go_to, go_along, look_at, reach, set_ground } = calls;
  for (const [name, given] of Object.entries(calls))
    if (name in acts) session.act(acts[name]!, given as Some);
  if (look_at) session.lookAt(look_at.points, look_at);
  if (reach) session.reach(reach.hand, reach.points, reach);
  if (put) session.put(put);
  if (push) session.push(push);
  if (control) session.control(control);
  if (keep_apart !== undefined) session.keepApart(keep_apart);
  if (go_to) session.goTo(go_to.points, go_to);
  if (go_along) session.goAlong(go_along.points!, go_along);
  if (set_ground !== undefined) session.setGround(set_ground && GROUNDS[set_ground]);
}

/** The calls of python.json, and some pictures of each, with the feet held and without. */
async function steers(read: Read): Promise<void> {
  const { model } = await loaded(read, "control", ControlModel);
  for (const [holdFeet, wanted] of [
    [false, python.steered],
    [true, python.held],
  ] as const) {
    const session = model.start({ characters: 2, holdFeet });
    const acts: Acts = {
      act: actOf(model, "act", python.acted.flat()),
      crouch: actOf(model, "crouch", python.crouched.flat()),
      end: null,
      jump: "jump",
    };
    const found = (python.steering as Call[]).flatMap((calls, call) => {
      obey(session, calls, acts);
      const pictures = Array.from({ length: 36 }, () => session.advance(1 / 48));
      const happened = [0, 1].map((figure) =>
        pictures.flatMap((poses) => poses[figure]!.events.map(({ kind, name }) => [kind, name ?? ""])),
      );
      if (holdFeet) equal(happened, python.happened[call], `events after call ${call}`);
      return pictures.filter((_, at) => at % 12 === 0);
    });
    equal(found.length, wanted.length, "pictures");
    found.forEach((poses, at) =>
      poses.forEach(({ ground, hips, rotations, contacts }, figure) => {
        close(
          [...ground, hips[1], ...Object.values(rotations).flat(), ...contacts],
          wanted[at]![figure]!,
          `figure ${figure} in picture ${at}, held: ${holdFeet}`,
        );
      }),
    );
  }
}

/** Calls of twelve figures that reach most numbers of steering: where each is after each call and its bones' rotations, summed;
 *  who did what in which picture; and for how many pictures hands were out of reach. */
async function crowd(read: Read): Promise<void> {
  const { model } = await loaded(read, "control", ControlModel);
  const { stand, acts: given, calls, made, rows: wanted, happened, beyond } = python.crowd;
  const acts: Acts = { jump: "jump" };
  const lengths = Object.entries(given).map(([name, { last, shares }]) => {
    const frames = shares.flatMap((share) => stand.map((value, at) => value + share * (last[at]! - value)));
    const act = actOf(model, name, frames);
    acts[name] = act;
    return [act.height.length, act.legs];
  });
  equal(lengths, made, "frames of acts, and whether they are of the legs");
  const session = model.start({ characters: wanted[0]!.length });
  (calls as Call[]).forEach((call, at) => {
    obey(session, call, acts);
    const events: Record<string, number[]> = {};
    const missed = Array<number>(2 * session.characters).fill(0);
    let poses: ReturnType<ControlSession["advance"]> = [];
    for (let picture = 0; picture < 36; picture++) {
      poses = session.advance(1 / 48);
      session.outOfReach.flat().forEach((is, hand) => (missed[hand]! += is ? 1 : 0));
      poses.forEach((pose, figure) =>
        pose.events.forEach(({ kind, name }) =>
          (events[name ? `${kind} ${name}` : kind] ??= []).push(figure, picture),
        ),
      );
    }
    poses.forEach(({ ground, hips, rotations }, figure) => {
      const bones = Object.values(rotations);
      const turns = [0, 1, 2].map((axis) => bones.reduce((sum, turn) => sum + turn[axis]!, 0));
      close([...ground, hips[1], ...turns], wanted[at]![figure]!, `figure ${figure} after call ${at}`);
    });
    equal(events, happened[at], `events after call ${at}`);
    const out = missed.flatMap((count, hand) => (count ? [[hand, count]] : []));
    equal(out, beyond[at], `pictures with hands out of reach after call ${at}`);
  });
}

/** Words as they are, of a known stem, misspelt, common and unknown. */
async function words(): Promise<void> {
  const { vocabulary, rules, common, read, ids } = python.known;
  const known = new Vocabulary(vocabulary, rules as unknown as TextTables, common);
  for (const [word, wanted] of Object.entries(read))
    equal([known.meant(word), known.near(word)], wanted, word);
  equal(known.encode(Object.keys(read).join(" ")).ids, ids, "ids");
}

/** What is nearest to sentences and to frames among their parts, and whether it is like them. */
async function searched(read: Read): Promise<void> {
  const { model, frames } = await loaded(read, "search", SearchModel);
  const all = frames("frames");
  const parts = await Promise.all(
    [all.slice(0, 10), all.slice(5), all].map((part) => model.embedMotion(part)),
  );
  const hits = await Promise.all([...python.searched.texts, all].map((query) => model.search(query, parts)));
  equal(
    hits.map((row) => row.map(({ index, like }) => [index, like])),
    python.searched.hits,
    "hits",
  );
}

export const cases: Case[] = [
  ...graphs,
  { name: "describe says what Python says", run: describe },
  { name: "generate draws what Python draws", run: generate },
  { name: "words are known as in Python", run: words },
  { name: "predict continues as Python does", run: predict },
  { name: "fill fills as Python does", run: fill },
  { name: "search embeds as Python does", run: search },
  { name: "control runs along targets as Python does", run: steersTargets },
  { name: "control steers as Python does, with feet held and without", run: steers },
  { name: "control leads a crowd as Python does", run: crowd },
  { name: "a seed generates the motion that it does in Python", run: seeds },
  { name: "motions say what is shown, and what that lacks, as in Python", run: taken },
  { name: "a story, and its stream, are those of Python", run: story },
  { name: "draws agree on what they do in Python", run: agreed },
  { name: "errors are expected as in Python", run: expected },
  { name: "long motions are embedded as in Python", run: long },
  { name: "what is found is like what was asked for where it is in Python", run: searched },
  { name: "a walk that is played backwards is told to be, as in Python", run: backwards },
];
