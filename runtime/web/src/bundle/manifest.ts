/* What a manifest must be for the rest to rely on it: types, ranges and references, each refused with its place. */
import { FIELDS } from "../generated.js";
import { DTYPES } from "./arrays.js";
import { BundleError } from "../errors.js";

const MOST_SIZE = 2 ** 31;
const MOST_FPS = 1000;
const TENSOR_TYPES = ["float32", "int64", "bool"];
const TEXTS = ["name", "version", "verb", "model", "loop"];
const OBJECTS = ["files", "graphs", "tables", "golden", "motion", "defaults", "settings", "config"];

type Fields = Record<string, unknown>;

/** Refuse a manifest that does not hold what every reader needs; BundleError names the place. */
export function checkManifest(manifest: Fields): void {
  for (const key of TEXTS) check(typeof manifest[key] === "string", key, "is no text");
  for (const key of OBJECTS) check(isObject(manifest[key]), key, "is no object");
  for (const [name, entry] of entries(manifest.files)) {
    check(
      isCount(entry.size) && typeof entry.sha256 === "string",
      `files.${name}`,
      "needs a size and a sha256",
    );
  }
  for (const [role, graph] of entries(manifest.graphs)) checkGraph(`graphs.${role}`, graph);
  for (const [name, table] of entries(manifest.tables)) {
    check(
      typeof table.file === "string" && String(table.dtype) in DTYPES,
      `tables.${name}`,
      "needs a file and a dtype",
    );
    check(isListOf(table.shape, isCount), `tables.${name}.shape`, "must hold whole numbers");
  }
  checkMotion(manifest.motion as Fields);
  for (const [feature, values] of entries(manifest.settings)) {
    for (const [key, value] of Object.entries(values)) {
      const fits = typeof value !== "number" || Math.abs(value) <= FIELDS.LARGEST_NUMBER;
      check(fits && value !== null, `settings.${feature}.${key}`, "is no number of a setting");
    }
  }
  const { vocabulary, actions, commands } = manifest;
  check(vocabulary === undefined || isTexts(vocabulary), "vocabulary", "must hold texts");
  const named = (action: unknown) =>
    isObject(action) && typeof action.sentence === "string" && isTexts(action.words);
  const hasActions = actions === undefined || isListOf(actions, named);
  check(hasActions, "actions", "must hold sentences with their words");
  const meant = (command: unknown) =>
    isObject(command) &&
    typeof command.sentence === "string" &&
    isCount(command.action) &&
    isTexts(command.texts) &&
    isTexts(command.instead);
  const hasCommands = commands === undefined || isListOf(commands, meant);
  check(hasCommands, "commands", "must hold sentences with their actions and texts");
}

function checkGraph(place: string, graph: Fields): void {
  check(typeof graph.file === "string", `${place}.file`, "is no text");
  check(typeof (graph.weights ?? "") === "string", `${place}.weights`, "is no text");
  for (const key of ["inputs", "outputs"]) {
    const tensors = graph[key];
    check(isListOf(tensors, isObject) && tensors.length > 0, `${place}.${key}`, "must hold tensors");
    for (const [at, { name, dtype, shape }] of (tensors as Fields[]).entries()) {
      check(
        typeof name === "string" && TENSOR_TYPES.includes(String(dtype)),
        `${place}.${key}.${at}`,
        "needs a name and a dtype",
      );
      const axis = (size: unknown) => typeof size === "string" || (isCount(size) && size > 0);
      check(isListOf(shape, axis), `${place}.${key}.${at}.shape`, "must hold sizes, or names of axes");
    }
  }
  const names = (key: string) => (graph[key] as Fields[]).map((tensor) => tensor.name);
  check(isObject(graph.feedback), `${place}.feedback`, "is no object");
  for (const [input, output] of Object.entries(graph.feedback as Fields)) {
    check(
      names("inputs").includes(input) && names("outputs").includes(output),
      `${place}.feedback.${input}`,
      "is no tensor of the graph",
    );
  }
  check(graph.start === undefined || isObject(graph.start), `${place}.start`, "is no object");
  for (const [state, sizes] of Object.entries((graph.start ?? {}) as Fields)) {
    check(isListOf(sizes, isCount), `${place}.start.${state}`, "must hold whole numbers");
  }
}

function checkMotion({ channels, units, mean, std, fps, skeleton }: Fields): void {
  check(
    isTexts(channels) && isTexts(units) && units.length === channels.length,
    "motion",
    "does not say what frames are",
  );
  for (const [key, numbers] of Object.entries({ mean, std })) {
    const fits = isListOf(numbers, Number.isFinite) && numbers.length === channels.length;
    check(fits, `motion.${key}`, "must hold a number for each channel");
  }
  const isSpread = (std as number[]).every((deviation) => deviation > 0);
  check(isSpread, "motion.std", "must be above 0");
  check(
    typeof fps === "number" && fps > 0 && fps <= MOST_FPS,
    "motion.fps",
    `must be above 0, and at most ${MOST_FPS}`,
  );
  const joints = isObject(skeleton) ? skeleton.joints : [];
  check(isListOf(joints, isObject), "motion.skeleton", "must hold joints");
  for (const [at, { name, parent, offset }] of (joints as Fields[]).entries()) {
    const below = Number.isInteger(parent) && (parent as number) >= -1 && (parent as number) < at;
    const placed = isListOf(offset, Number.isFinite) && offset.length === 3;
    check(
      typeof name === "string" && below && placed,
      `motion.skeleton.joints.${at}`,
      "needs a name, a parent before it and an offset",
    );
  }
}

function check(fits: boolean, place: string, fault: string): asserts fits {
  if (!fits) throw new BundleError(`manifest, ${place}: ${fault}`);
}

function entries(object: unknown): [string, Fields][] {
  const pairs = Object.entries(object as Fields);
  for (const [key, value] of pairs) check(isObject(value), key, "is no object");
  return pairs as [string, Fields][];
}

function isCount(value: unknown): value is number {
  return Number.isInteger(value) && (value as number) >= 0 && (value as number) <= MOST_SIZE;
}

function isListOf(value: unknown, fits: (item: unknown) => boolean): value is unknown[] {
  return Array.isArray(value) && value.every(fits);
}

function isTexts(value: unknown): value is string[] {
  return isListOf(value, (text) => typeof text === "string");
}

export function isObject(value: unknown): value is Fields {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
