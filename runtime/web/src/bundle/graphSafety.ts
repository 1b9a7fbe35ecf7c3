/*
 * Graphs that could reach outside their own bytes, or never end, are refused before ONNX Runtime sees them:
 * docs/reference/bundle.md, "What a reader has to refuse". The whole protocol buffer is walked, with every graph in an attribute.
 */
import { GRAPH_SAFETY } from "../generated.js";
import { BundleError } from "../errors.js";

interface Message {
  readonly plain: readonly number[];
  readonly nested: Readonly<Record<number, string>>;
  /** The field that names the domain of operators, 0 for none. */
  readonly domain: number;
}

/** The fields of onnx.proto by number: plain ones, and messages that are looked into. All others are refused. */
const MESSAGES: Record<string, Message> = GRAPH_SAFETY.MESSAGES;

const OPERATOR = 4; // of a node
const LOCATION = 14; // of a tensor's data: 0 is in the file

/** BundleError where an ONNX model is damaged, could read other files, run foreign operators or loop for ever. */
export function checkGraph(model: Uint8Array): void {
  if (text(model.subarray(4, 8)) === "ORTM") {
    throw new BundleError("the graph is in ONNX Runtime's own format, which cannot be checked");
  }
  const waiting: [string, Uint8Array, number][] = [["model", model, 0]];
  let count = 0;
  for (let next = waiting.pop(); next; next = waiting.pop()) {
    const [kind, data, depth] = next;
    if (depth > GRAPH_SAFETY.MAX_DEPTH)
      throw new BundleError(`the graph is nested more than ${GRAPH_SAFETY.MAX_DEPTH} messages deep`);
    for (const [number, value] of fields(data)) {
      if (++count > GRAPH_SAFETY.MAX_FIELDS)
        throw new BundleError(`the graph has more than ${GRAPH_SAFETY.MAX_FIELDS} fields`);
      const inner = MESSAGES[kind]!.nested[number];
      if (inner) waiting.push([inner, message(value), depth + 1]);
      else checkField(kind, number, value);
    }
  }
}

function checkField(kind: string, number: number, value: number | Uint8Array): void {
  const { plain, domain } = MESSAGES[kind]!;
  if (kind === "tensor" && (number === 13 || number === LOCATION)) {
    if (value !== 0) throw new BundleError("a tensor of the graph has its data in another file");
    return;
  }
  if (!plain.includes(number))
    throw new BundleError(`a ${kind} of the graph has the unknown field ${number}`);
  if (kind === "node" && number === OPERATOR && text(message(value)) === "Loop") {
    throw new BundleError("the graph has the operator Loop, which may never end");
  }
  if (number === domain && !["", "ai.onnx"].includes(text(message(value)))) {
    throw new BundleError("the graph needs operators that are not ONNX's own");
  }
}

/** The fields of a message as [number, value]: a number, or the bytes of a text or message. */
function* fields(data: Uint8Array): Generator<[number, number | Uint8Array]> {
  let at = 0;
  const varint = (): number => {
    let value = 0;
    for (let shift = 0; shift < 70; shift += 7) {
      const byte = data[at++];
      if (byte === undefined) break;
      value += (byte & 127) * 2 ** shift;
      if (byte < 128) return value;
    }
    throw new BundleError("the graph is not valid ONNX: a number is unterminated");
  };
  while (at < data.length) {
    const tag = varint();
    const wire = tag % 8;
    const number = (tag - wire) / 8;
    if (number === 0 || tag >= 2 ** 32)
      throw new BundleError("the graph is not valid ONNX: a field has an invalid number");
    if (wire === 0) {
      yield [number, varint()];
      continue;
    }
    const size = wire === 2 ? varint() : { 1: 8, 5: 4 }[wire];
    if (size === undefined)
      throw new BundleError(`the graph is not valid ONNX: a field has the wire type ${wire}`);
    if (size > data.length - at) throw new BundleError("the graph is not valid ONNX: it is truncated");
    yield [number, data.subarray(at, at + size)];
    at += size;
  }
}

function message(value: number | Uint8Array): Uint8Array {
  if (typeof value === "number")
    throw new BundleError("the graph is not valid ONNX: a number where a message belongs");
  return value;
}

function text(bytes: Uint8Array): string {
  return new TextDecoder().decode(bytes);
}
