/* Which joint of a skeleton is which bone of the humanoid, by the names of joints: docs/reference/retargeting.md, "The tables of names". */
import { SKELETON } from "../../generated.js";
import { MotionError } from "../../errors.js";
import { ARM, LEG, SIDES } from "./bones.js";
import type { Vector } from "../../motion/rotations.js";
import { counted } from "../../motion/numbers.js";
import type { Skeleton } from "../../motion/skeleton.js";
import { type Table, TABLES } from "./tables.js";

/** The joints of a skeleton that are bones; spine and neck are all joints of a chain, upwards. */
export interface JointMap {
  joints: Record<string, number>;
  spine: number[];
  neck: number[];
  convention: string;
  /** From 0 to 1. */
  confidence: number;
  /** Where the convention rests in a pose of its own: bone -> rotation vector in degrees; and where bones point in it. */
  rest?: Record<string, Vector>;
  points: Record<string, Vector>;
  /** Where the convention rests in no body's pose: joint -> its axes that are left, up and forward, as "-z x -y". */
  axes: Record<number, string>;
}

const CHAINS = ["spine", "neck"];
const UNSIDED = ["hips", "head", ...CHAINS];
const NEEDED = [
  "hips",
  "spine",
  ...SIDES.flatMap((side) => [...LEG.slice(0, 3), ...ARM.slice(1, 3)].map((part) => side + part)),
];

/** The bones of limbs, from hip or shoulder on. */
export const LIMBS = SIDES.flatMap((side) =>
  [LEG, ARM.slice(1)].map((parts) => parts.map((part) => side + part)),
);

/** The bones whose lengths tell that a figure is whole. */
export const MEASURED = NEEDED.slice(2);

/** The joint that carries legs and back: the hips, or what they hang on where the back is not theirs. */
export function carrierOf({ joints, spine }: JointMap, skeleton: Skeleton): number {
  const above = skeleton.above(spine[0]!);
  return skeleton.above(joints.hips!).find((joint) => above.includes(joint))!;
}

/** A table for one way of writing the sides: of each bone the plain names that its joint can have. */
interface Convention {
  title: string;
  names: Record<string, string[]>;
  /** Names of bones as files write them. */
  spelled: Set<string>;
  aside: Set<string>;
  /** Of these each file of the convention has one, if there are any. */
  marks: string[];
  /** Bones that only some files have. */
  optional: Set<string>;
  prefixes: string[];
  rest?: Record<string, Vector>;
  points: Record<string, Vector>;
  axes: Record<string, string>;
}

const CONVENTIONS = TABLES.flatMap((table) => table.sides.map((sides) => conventionOf(table, sides)));

function conventionOf(table: Table, words: [string, string]): Convention {
  const names: Record<string, string[]> = {};
  const spelled = new Set<string>();
  for (const [bone, known] of Object.entries(table.joints)) {
    const sides = UNSIDED.includes(bone) ? [["", ""]] : SIDES.map((side, at) => [side, words[at]!]);
    for (const [side, word] of sides) {
      const written = known.map((name) => name.replaceAll("{s}", word!));
      names[side + bone] = written.map(plain);
      written.forEach((name) => spelled.add(name));
    }
  }
  const ofBoth = (known: string[] = []) =>
    known.flatMap((name) => words.map((word) => plain(name.replaceAll("{s}", word))));
  return {
    title: table.title,
    names,
    spelled,
    aside: new Set(ofBoth(table.aside)),
    marks: ofBoth(table.marks),
    optional: new Set(
      (table.optional ?? []).flatMap((bone) =>
        UNSIDED.includes(bone) ? [bone] : SIDES.map((side) => side + bone),
      ),
    ),
    prefixes: table.prefixes ?? [],
    rest: table.rest && bothSides(table.rest, [1, -1, -1]),
    points: bothSides(table.points ?? {}, [-1, 1, 1]),
    axes: Object.fromEntries(Object.entries(table.axes ?? {}).map(([name, axes]) => [plain(name), axes])),
  };
}

/** Vectors of the left side and, mirrored by signs, of the right. */
function bothSides(ofLeft: Record<string, Vector>, signs: Vector): Record<string, Vector> {
  const axes: Record<string, Vector> = {};
  for (const [bone, direction] of Object.entries(ofLeft)) {
    if (UNSIDED.includes(bone)) axes[bone] = direction;
    else {
      axes[`left${bone}`] = direction;
      axes[`right${bone}`] = direction.map((value, axis) => signs[axis]! * value) as Vector;
    }
  }
  return axes;
}

/** A name without what differs between files: case, separators, and how letters are encoded. */
function plain(name: string): string {
  return name
    .normalize("NFKC")
    .toLowerCase()
    .replace(/[^\p{L}\p{N}]/gu, "");
}

/** The map by the table that fits best; MotionError where none does, or joints are missing or out of order. */
export function mapOf(skeleton: Skeleton): JointMap {
  const bare = withoutNumbers(skeleton.names);
  const written = [skeleton.names, bare, withoutNumbers(bare)].map(withoutFirstWords); // a second program adds a second number
  const matches = written.flatMap((names) =>
    CONVENTIONS.map((convention) => match(convention, skeleton, names)),
  );
  matches.sort((a, b) => b.known - a.known || b.spelled - a.spelled || a.absent - b.absent);
  const fullest = matches[0]!;
  const reason = onOneSide(missing(fullest.map), fullest.map);
  const best = reason ? fullest : (matches.find(({ map }) => !missing(map).length) ?? fullest);
  const lacking = missing(best.map);
  if (
    lacking.length &&
    !(Object.keys(best.map.joints).length >= 6 && best.known > 0.5 * skeleton.names.length)
  ) {
    throw new MotionError("no table of joints' names fits this skeleton: give a map of bones and joints");
  }
  return checkedMap(skeleton, best.map);
}

/** How well a convention fits: joints that it has names for, those spelled as it spells them, and its bones that are absent. */
interface Score {
  known: number;
  spelled: number;
  absent: number;
}

/** The map that a convention makes of a skeleton's names, as they are written, and how well it fits. */
function match(convention: Convention, skeleton: Skeleton, written: string[]): Score & { map: JointMap } {
  const bare = withoutPrefixes(convention, written);
  const names = bare.map(plain);
  checkHips(convention, skeleton, names);
  const joints = limbJoints(convention, names);
  const score = scoreOf(convention, names, bare, joints);
  const { known, absent } = score;
  // other makers' figures of these names have joints besides, or rest in another pose
  const whole = known >= skeleton.names.filter((name) => !name.endsWith(SKELETON.END_SUFFIX)).length;
  const map = {
    joints,
    spine: chainOf(convention, "spine", names),
    neck: chainOf(convention, "neck", names),
    convention: convention.title,
    confidence: Math.round(100 * (1 - (0.3 * absent) / Math.max(absent + known, 1))) / 100,
    rest: whole ? convention.rest : undefined,
    points: convention.points,
    axes: Object.fromEntries(
      names.flatMap((name, at) => (convention.axes[name] ? [[at, convention.axes[name]!]] : [])),
    ),
  };
  return { ...score, map };
}

/** Names without the prefixes that a convention's names can have. */
function withoutPrefixes(convention: Convention, names: string[]): string[] {
  const pattern = convention.prefixes.map((prefix) => `(?:${prefix})[ _:.-]*`).join("|") || "(?!)";
  const prefix = new RegExp(`^(?:${pattern})(?=.)`, "i");
  return names.map((name) => name.replace(prefix, "").split(/[:|]/).at(-1)!);
}

/** MotionError where two joints with plain names are hips that carry three joints and more. */
function checkHips(convention: Convention, skeleton: Skeleton, names: string[]): void {
  const hips = names.filter(
    (name, at) => name === convention.names.hips![0] && skeleton.children[at]!.length >= 3,
  );
  if (hips.length > 1) throw new MotionError("this file has two hips: put each figure in a file of its own");
}

/** For each bone but back and neck the first joint of a plain name that it can have. */
function limbJoints(convention: Convention, names: string[]): Record<string, number> {
  const joints: Record<string, number> = {};
  for (const [bone, known] of Object.entries(convention.names)) {
    const joint = known.map((name) => names.indexOf(name)).find((at) => at >= 0);
    if (!CHAINS.includes(bone) && joint !== undefined) joints[bone] = joint;
  }
  return joints;
}

/** The joints of back or neck, in the skeleton's order. */
function chainOf(convention: Convention, chain: string, names: string[]): number[] {
  return (convention.names[chain] ?? [])
    .map((name) => names.indexOf(name))
    .filter((at) => at >= 0)
    .sort((a, b) => a - b);
}

function scoreOf(
  convention: Convention,
  names: string[],
  bare: string[],
  joints: Record<string, number>,
): Score {
  // without a mark these names are another convention's
  const accepted = new Set([...Object.values(convention.names).flat(), ...convention.aside]);
  const isMarked = !convention.marks.length || convention.marks.some((name) => names.includes(name));
  const known = isMarked ? names.filter((name) => accepted.has(name)).length : 0;
  const spelled = bare.filter((name) => convention.spelled.has(name)).length;
  // bones that the convention has and this skeleton lacks
  let absent = 0;
  for (const chain of CHAINS) absent += absentInChain(convention, chain, names);
  for (const bone of Object.keys(convention.names)) {
    if (CHAINS.includes(bone) || convention.optional.has(bone)) continue;
    if (joints[bone] === undefined) absent++;
  }
  return { known, spelled, absent };
}

/** The number of bones of back or neck that are absent, and one more if none is there. */
function absentInChain(convention: Convention, chain: string, names: string[]): number {
  const known = convention.names[chain] ?? [];
  const absent = known.filter((name) => !names.includes(name)).length;
  if (absent < known.length) return absent;
  return convention.optional.has(chain) || !known.length ? 0 : 1 + absent;
}

function nearlyAll(count: number, names: string[]): boolean {
  return count > 0.8 * names.length;
}

/** The value that is there most often, and how often. */
function commonest(values: string[]): [value: string, count: number] {
  const none: [string, number] = ["", 0];
  return [...counted(values)].reduce((best, other) => (other[1] > best[1] ? other : best), none);
}

/** Names without the numbers that programs add at their ends. */
function withoutNumbers(names: string[]): string[] {
  const bare = names.map((name) => name.replace(/(?<=.)[ ._-]+[0-9]+$/, ""));
  if (nearlyAll(bare.filter((name, at) => name !== names[at]).length, names)) return bare;
  const [last, count] = commonest(names.map((name) => name.slice(-1)));
  if (/[0-9]/.test(last) && nearlyAll(count, names)) {
    return names.map((name) => (name.length > 1 && name.endsWith(last) ? name.slice(0, -1) : name));
  }
  return bare.map((name, at) => (bare.indexOf(name) === bare.lastIndexOf(name) ? name : names[at]!));
}

/** Names without the words, or numbers, with which nearly all begin. */
function withoutFirstWords(names: string[]): string[] {
  const first = /^(?:[0-9]+[ _:.|-]*|\p{L}[\p{L}\p{N}]*[ _:.|-]+)(?=.)/u;
  const [word, count] = commonest(names.flatMap((name) => first.exec(name)?.[0] ?? []));
  if (!word || !nearlyAll(count, names)) return names;
  return withoutFirstWords(names.map((name) => (name.startsWith(word) ? name.slice(word.length) : name)));
}

/** A map of a user's own: bone -> the joint's name, of spine and neck all names, upwards. MotionError says what is wrong. */
export function mapFrom(skeleton: Skeleton, named: Record<string, string | string[]>): JointMap {
  const places: Record<string, number[]> = {};
  for (const [bone, names] of Object.entries(named)) {
    const known =
      UNSIDED.includes(bone) || SIDES.some((side) => [...LEG, ...ARM].some((part) => side + part === bone));
    if (!known) throw new MotionError(`${JSON.stringify(bone)} is not a bone of the humanoid`);
    places[bone] = [names].flat().map((name) => skeleton.index(name));
    if (!CHAINS.includes(bone) && places[bone]!.length !== 1)
      throw new MotionError(`${bone}: only spine and neck take a list`);
  }
  const used = Object.values(places).flat();
  if (new Set(used).size < used.length) throw new MotionError("a joint can be only one bone");
  const { spine = [], neck = [], ...limbs } = places;
  const joints = Object.fromEntries(Object.entries(limbs).map(([bone, [joint]]) => [bone, joint!]));
  return checkedMap(skeleton, {
    joints,
    spine,
    neck,
    convention: "a map",
    confidence: 1,
    points: {},
    axes: {},
  });
}

const PARTNERS = Object.fromEntries(
  [...LEG, ...ARM].flatMap((part) => [
    [`left${part}`, `right${part}`],
    [`right${part}`, `left${part}`],
  ]),
) as Record<string, string>;

/** The needed bones that are missing, and those that are there on the other side only. */
function missing({ joints, spine }: JointMap): string[] {
  const there = new Set([...Object.keys(joints), ...(spine.length ? ["spine"] : [])]);
  const oneSided = Object.keys(PARTNERS).filter((bone) => there.has(PARTNERS[bone]!));
  return [...new Set([...NEEDED, ...oneSided])].filter((bone) => !there.has(bone));
}

function onOneSide(lacking: string[], { joints }: JointMap): boolean {
  return (
    lacking.length > 0 && lacking.every((bone) => PARTNERS[bone] && joints[PARTNERS[bone]!] !== undefined)
  );
}

function checkedMap(skeleton: Skeleton, map: JointMap): JointMap {
  const lacking = missing(map);
  const where = onOneSide(lacking, map) ? " (joints are missing on one side only)" : "";
  if (lacking.length)
    throw new MotionError(
      `no joint was found for ${lacking.join(", ")}${where}; give a map of bones and joints`,
    );
  const chains = [map.spine, [map.spine[0]!, ...map.neck]];
  for (const side of SIDES) {
    const limb = (parts: string[]) =>
      parts.map((part) => map.joints[side + part]).filter((joint) => joint !== undefined);
    chains.push([map.joints.hips!, ...limb(LEG)], [map.spine[0]!, ...limb(ARM)]);
  }
  for (const chain of chains) {
    chain.slice(1).forEach((lower, at) => {
      if (lower === chain[at]! || !skeleton.above(lower).includes(chain[at]!)) {
        throw new MotionError(
          `joints are out of order: ${skeleton.names[lower]} does not hang on ${skeleton.names[chain[at]!]}`,
        );
      }
    });
  }
  return map;
}
