/* BVH: a skeleton and a motion in a text; angles are degrees, and nothing says the unit of lengths. */
import { SKELETON, TEXT } from "../generated.js";
import { FormatError, MotionError } from "../errors.js";
import { eulersOf, fromEuler } from "../motion/euler.js";
import { checked, type Motion } from "../motion/motion.js";
import { type Quaternion, RADIANS, type Vector } from "../motion/rotations.js";
import { type Joint, Skeleton, unique } from "../motion/skeleton.js";

const LONGEST = 2 ** 28;

interface Node {
  joint: Joint;
  line: number;
  placed: boolean;
  channels: string[];
}

/** Read a BVH text; FormatError names the line of what is wrong. */
export function readBVH(content: string | Uint8Array): Motion {
  if (content.length > LONGEST) throw new FormatError("this file is too large for a BVH file");
  const text = typeof content === "string" ? content : new TextDecoder().decode(content);
  if (text.includes("\0")) throw new FormatError("not a text file");
  const lines = text.replace(/^\ufeff/, "").split(/\r\n|\r|\n/);
  const { nodes, end } = hierarchy(lines);
  const { start, frames, fps } = header(lines, end);
  const channels = nodes.flatMap((node, joint) => node.channels.map((kind) => ({ joint, kind })));
  const values = valuesOf(lines, start, channels.length);
  const count = channels.length ? values.length / channels.length : frames;
  if (count < frames)
    throw new FormatError(
      `line ${start}: the file declares ${frames} frames but holds ${count}: it is cut short`,
    );
  if (count * nodes.length > 2 ** 25)
    throw new FormatError(`${count} frames of ${nodes.length} joints are too many`);
  const skeleton = new Skeleton(nodes.map((node) => node.joint));
  const rotations: Quaternion[][] = [];
  const translations: Vector[][] = [];
  for (let frame = 0; frame < count; frame++) {
    const { turned, moved } = posed(skeleton, channels, values.subarray(frame * channels.length));
    rotations.push(turned);
    translations.push(moved);
  }
  const travels = channels.some(({ kind }) => kind[0] === "t");
  return checked({ skeleton, fps, rotations, translations, travels });
}

function posed({ joints }: Skeleton, channels: { joint: number; kind: string }[], values: Float64Array) {
  const angles = joints.map((): Vector => [0, 0, 0]);
  const moved = joints.map(({ offset }) => offset);
  channels.forEach(({ joint, kind }, at) => {
    if (kind[0] === "r") angles[joint]![joints[joint]!.order.indexOf(kind[1]!)] = values[at]! * RADIANS;
    else {
      if (moved[joint] === joints[joint]!.offset) moved[joint] = [...joints[joint]!.offset];
      moved[joint]!["xyz".indexOf(kind[1]!)] = values[at]!;
    }
  });
  return { turned: angles.map((jointAngles, at) => fromEuler(jointAngles, joints[at]!.order)), moved };
}

/** The joints, and the number of the line MOTION after them. */
function hierarchy(lines: string[]): { nodes: Node[]; end: number } {
  const nodes: Node[] = [];
  const open: number[] = [];
  const taken = new Set<string>();
  let declared = false; // a joint has been named and its brace must follow
  for (const [at, content] of lines.entries()) {
    for (const statement of content
      .split(/([{}])/)
      .map((piece) => piece.trim())
      .filter(Boolean)) {
      const [, word, rest] = /^(\S+)\s*(.*)$/.exec(statement) as unknown as [string, string, string];
      const keyword = word.toLowerCase();
      const line = at + 1;
      const names = ["root", "joint", "end"].includes(keyword);
      const inside = open.length > 0 && !declared;
      if (names && !declared && inside === (keyword !== "root") && (inside || !nodes.length)) {
        nodes.push(nodeOf(keyword, rest, open.at(-1) ?? -1, nodes, taken, line));
      } else if (keyword === "{" && declared) open.push(nodes.length - 1);
      else if (keyword === "}" && inside) open.pop();
      else if (keyword === "offset" && inside) place(nodes[open.at(-1)!]!, rest, line);
      else if (keyword === "channels" && inside) channel(nodes[open.at(-1)!]!, rest, line);
      else if (keyword === "motion" && nodes.length && !open.length && !declared)
        return { nodes: whole(nodes), end: at };
      else if (keyword !== "hierarchy" || nodes.length)
        throw new FormatError(`line ${line}: ${quoted(statement)} does not belong here`);
      declared = names;
    }
  }
  throw new FormatError("not a BVH file, or cut short: the line MOTION is missing");
}

function nodeOf(
  keyword: string,
  name: string,
  parent: number,
  nodes: Node[],
  taken: Set<string>,
  line: number,
): Node {
  const wanted = keyword === "end" ? nodes[parent]!.joint.name + SKELETON.END_SUFFIX : name || "joint";
  return {
    joint: { name: unique(wanted, taken), parent, offset: [0, 0, 0], order: "zyx" },
    line,
    placed: false,
    channels: [],
  };
}

function place(node: Node, rest: string, line: number): void {
  const values = numbers(rest, line);
  if (values.length !== 3)
    throw new FormatError(`line ${line}: expected three numbers, not ${values.length}`);
  node.joint.offset = values as Vector;
  node.placed = true;
}

function channel(node: Node, rest: string, line: number): void {
  const [count, ...words] = rest.split(/\s+/);
  node.channels = words.map((word) => {
    const match = /^([xyz])(position|rotation)$/i.exec(word);
    if (!match)
      throw new FormatError(`line ${line}: channel ${quoted(word)}: expected one of Xposition ... Zrotation`);
    return (match[2]!.toLowerCase() === "position" ? "t" : "r") + match[1]!.toLowerCase();
  });
  if (count !== `${words.length}` || new Set(node.channels).size < words.length) {
    throw new FormatError(
      `line ${line}: CHANNELS needs a count and that many different channels, not ${quoted(rest)}`,
    );
  }
  const turns = node.channels
    .filter((kind) => kind[0] === "r")
    .map((kind) => kind[1]!)
    .join("");
  // a missing axis does not turn: it comes where z, y and x come first
  const orders = ["zyx", "zxy", "yzx", "yxz", "xzy", "xyz"];
  node.joint.order = orders.find(
    (order) =>
      Array.from(order)
        .filter((axis) => turns.includes(axis))
        .join("") === turns,
  )!;
}

function whole(nodes: Node[]): Node[] {
  const bare = nodes.find((node) => !node.placed);
  if (bare) throw new FormatError(`line ${bare.line}: joint ${quoted(bare.joint.name)} has no OFFSET`);
  return nodes;
}

/** The number of lines before the first frame, the declared number of frames and the frame rate. */
function header(lines: string[], end: number): { start: number; frames: number; fps: number } {
  let [frames, fps]: (number | undefined)[] = [];
  for (let at = end + 1; at < lines.length; at++) {
    const content = lines[at]!.trim();
    const match = /^(frames|frame\s+time)\s*:\s*(\S+)$/i.exec(content);
    if (match && match[1]!.toLowerCase() === "frames" && /^[0-9]{1,15}$/.test(match[2]!))
      frames = Number(match[2]);
    else if (match && match[1]!.toLowerCase() !== "frames") fps = rate(match[2]!, at + 1);
    else if (content)
      throw new FormatError(
        `line ${at + 1}: expected 'Frames: N' and 'Frame Time: SECONDS', not ${quoted(content)}`,
      );
    if (frames !== undefined && fps !== undefined) return { start: at + 1, frames, fps };
  }
  throw new FormatError("cut short: the file ends before 'Frames:' and 'Frame Time:'");
}

/** A whole number of frames a second if the digits of the frame time allow only one. */
function rate(word: string, line: number): number {
  const seconds = numbers(word, line)[0]!;
  const fps = 1 / seconds;
  const [low, high] = TEXT.FRAME_RATES;
  if (!(fps >= low && fps <= high))
    throw new FormatError(`line ${line}: frame time ${word} s is out of range`);
  const [, digits = "", power = "0"] = /^[^.e]*(?:\.([0-9]*))?(?:e(.*))?$/i.exec(word) ?? [];
  const precision = 0.51 * 10 ** (Number(power) - digits.length);
  const near = [-1, 0, 1]
    .map((step) => Math.round(fps) + step)
    .filter((candidate) => candidate > 0 && Math.abs(1 / candidate - seconds) <= precision);
  return near.length === 1 ? near[0]! : fps;
}

function valuesOf(lines: string[], start: number, width: number): Float64Array {
  const values: number[] = [];
  if (!width) return new Float64Array();
  for (let at = start; at < lines.length; at++) {
    for (const value of numbers(lines[at]!, at + 1)) values.push(value);
  }
  if (values.length % width)
    throw new FormatError(
      `${values.length} values do not make whole frames of ${width}: the file is cut short`,
    );
  return Float64Array.from(values);
}

function numbers(content: string, line: number): number[] {
  return content
    .split(/\s+/)
    .filter(Boolean)
    .map((word) => {
      if (!/^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?$/i.test(word) || !Number.isFinite(Number(word))) {
        throw new FormatError(`line ${line}: ${quoted(word)} is not a finite number`);
      }
      return Number(word);
    });
}

function quoted(text: string): string {
  return JSON.stringify(text.slice(0, 60));
}

/** The text of a BVH file that every reader accepts: rotations are Z Y X, and the root and joints that move have six channels. */
export function toBVH(motion: Motion): string {
  const { skeleton, rotations, translations, fps } = checked(motion);
  const still = skeleton.joints.map((_, at) =>
    translations.every((moves) => same(moves[at]!, translations[0]![at]!)),
  );
  const moving = (at: number) => at === 0 || !still[at];
  const { lines, order } = tree(skeleton, moving, (at) =>
    at && still[at] ? translations[0]![at]! : skeleton.joints[at]!.offset,
  );
  const angles = skeleton.joints.map((_, at) => {
    const turns = rotations.map((row) => row[at]!);
    return eulersOf(turns, "zyx");
  });
  const rows = rotations.map((_, frame) =>
    order
      .flatMap((at) => [
        ...(moving(at) ? translations[frame]![at]! : []),
        ...angles[at]![frame]!.map((angle) => angle / RADIANS),
      ])
      .map(number)
      .join(" "),
  );
  return [
    "HIERARCHY",
    ...lines,
    "MOTION",
    `Frames: ${rows.length}`,
    `Frame Time: ${1 / fps}`,
    ...rows,
    "",
  ].join("\n");
}

function same(a: Vector, b: Vector): boolean {
  return a.every((value, axis) => Math.abs(value - b[axis]!) < 1e-9);
}

function number(value: number): string {
  if (!Number.isFinite(value)) throw new MotionError("values of this motion are too large to convert");
  return `${Math.round(value * 1e9) / 1e9}`;
}

/** The lines of the hierarchy, and the joints of it in order; lone tips are End Sites. */
function tree(skeleton: Skeleton, moving: (joint: number) => boolean, offset: (joint: number) => Vector) {
  const lines: string[] = [];
  const order: number[] = [];
  const names = plainNames(skeleton.names);
  const write = (at: number, depth: number): void => {
    const indent = "\t".repeat(Math.min(depth, 40));
    const children = skeleton.children[at]!;
    const lone =
      children.length === 1 &&
      skeleton.names[children[0]!]!.endsWith(SKELETON.END_SUFFIX) &&
      !skeleton.children[children[0]!]!.length;
    const spaced = (vector: Vector) => vector.map(number).join(" ");
    order.push(at);
    lines.push(
      `${indent}${at ? "JOINT" : "ROOT"} ${names[at]}`,
      `${indent}{`,
      `${indent}\tOFFSET ${at ? spaced(offset(at)) : "0 0 0"}`,
    );
    lines.push(
      `${indent}\tCHANNELS ${moving(at) ? "6 Xposition Yposition Zposition" : "3"} Zrotation Yrotation Xrotation`,
    );
    if (children.length === 0 || lone) {
      const tip = lone ? offset(children[0]!) : ([0, 0, 0] as Vector);
      lines.push(`${indent}\tEnd Site`, `${indent}\t{`, `${indent}\t\tOFFSET ${spaced(tip)}`, `${indent}\t}`);
    } else for (const child of children) write(child, depth + 1);
    lines.push(`${indent}}`);
  };
  write(0, 0);
  return { lines, order };
}

/** Names without blanks and colons, at which some readers fail. */
function plainNames(names: string[]): string[] {
  const taken = new Set<string>();
  return names.map((name) => unique(name.replace(/[^\p{L}\p{N}_.-]/gu, "_") || "_", taken));
}
