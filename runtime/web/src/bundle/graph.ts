import { FIELDS } from "../generated.js";
import type { InferenceSession, TypedTensor } from "onnxruntime-web";
import type { NumberArray, Numbers } from "./arrays.js";
import { BundleError } from "../errors.js";
import { checkGraph } from "./graphSafety.js";
import { loaded, type Runtime } from "./runtime.js";

/** A tensor of a graph: a word in its shape is an axis of any size. */
export interface TensorSpec {
  name: string;
  dtype: "float32" | "int64" | "bool";
  shape: (number | string)[];
}

/** What a graph takes and gives, and which outputs come back as inputs of the next step. */
export interface GraphSpec {
  inputs: TensorSpec[];
  outputs: TensorSpec[];
  feedback: Record<string, string>;
  start?: Record<string, number[]>;
}

/** Settings of ONNX Runtime's session, such as `executionProviders`. */
export type SessionSettings = InferenceSession.SessionOptions;

export type Arrays = Record<string, NumberArray>;
export type Tensors = Record<string, NumberArray<Float32Array>>;

/** A function from named arrays to named arrays, computed by ONNX Runtime. */
export class Graph {
  private constructor(
    readonly role: string,
    readonly spec: GraphSpec,
    private readonly session: InferenceSession,
    private readonly runtime: Runtime,
  ) {}

  /** Load a graph that is safe and keeps the contract of the manifest; BundleError otherwise. */
  static async load(
    role: string,
    model: Uint8Array,
    spec: GraphSpec,
    settings: SessionSettings = {},
  ): Promise<Graph> {
    checkGraph(model);
    const runtime = await loaded().catch((error: unknown) => {
      throw new BundleError(`ONNX Runtime cannot be loaded (${String(error)}): npm install onnxruntime-web`);
    });
    const session = await runtime.InferenceSession.create(model, settings).catch((error: unknown) => {
      throw new BundleError(`graph ${role}: ONNX Runtime cannot load it: ${String(error)}`);
    });
    for (const [wanted, present] of [
      [spec.inputs, session.inputNames],
      [spec.outputs, session.outputNames],
    ] as const) {
      const names = wanted.map((tensor) => tensor.name);
      if (`${[...names].sort()}` !== `${[...present].sort()}`) {
        await session.release();
        throw new BundleError(
          `graph ${role}: it has ${present.join(", ")}, and its manifest ${names.join(", ")}`,
        );
      }
    }
    return new Graph(role, spec, session, runtime);
  }

  /** The outputs for inputs, which must have the contract's names, types and shapes. */
  async run(inputs: Arrays): Promise<Tensors> {
    const feeds: Record<string, TypedTensor<"float32"> | TypedTensor<"int64">> = {};
    for (const { name, dtype, shape } of this.spec.inputs) {
      const input = inputs[name];
      if (!input) throw new BundleError(`graph ${this.role}: the input ${name} is missing`);
      const fits =
        input.shape.length === shape.length &&
        shape.every((size, i) => typeof size === "string" || size === input.shape[i]);
      if (!fits || (dtype === "int64") !== input.data instanceof BigInt64Array) {
        throw new BundleError(
          `graph ${this.role}: ${name} is (${input.shape}), expected ${dtype} (${shape})`,
        );
      }
      feeds[name] =
        input.data instanceof BigInt64Array
          ? new this.runtime.Tensor("int64", input.data, input.shape)
          : new this.runtime.Tensor("float32", singles(input.data), input.shape);
    }
    const outputs = await this.session.run(feeds).catch((error: unknown) => {
      throw new BundleError(
        `graph ${this.role}: ONNX Runtime cannot compute it: ${String(error).slice(0, 200)}`,
      );
    });
    const results: Tensors = {};
    for (const [name, tensor] of Object.entries(outputs)) {
      const data = tensor.data as Float32Array | BigInt64Array;
      results[name] = { data: singles(data), shape: [...tensor.dims] }; // codes are int64, and small
      if (!bounded(results[name].data))
        throw new BundleError(
          `graph ${this.role}: ${name} is not finite, or beyond ${FIELDS.LARGEST_NUMBER}`,
        );
    }
    return results;
  }

  /** Give back the memory of ONNX Runtime; the graph is of no use then. */
  async release(): Promise<void> {
    await this.session.release();
  }

  /** The states of so many rows before the first step: zeros. */
  zeroState(rows: number): Tensors {
    const zeros: Tensors = {};
    for (const name of Object.keys(this.spec.feedback)) {
      const tensor = this.spec.inputs.find((input) => input.name === name);
      const sizes = this.spec.start?.[name] ?? tensor?.shape.slice(1).map(Number) ?? [];
      const shape = [rows, ...sizes];
      zeros[name] = { data: new Float32Array(shape.reduce((product, size) => product * size, 1)), shape };
    }
    return zeros;
  }

  /** One step: its outputs, and the states for the next one. */
  async step(inputs: Arrays, states: Arrays) {
    const outputs = await this.run({ ...states, ...inputs });
    const next: Tensors = {};
    for (const [name, source] of Object.entries(this.spec.feedback)) next[name] = outputs[source]!;
    return { outputs, states: next };
  }
}

function singles(data: NumberArray["data"]): Float32Array {
  return data instanceof Float32Array ? data : Float32Array.from(data as ArrayLike<unknown>, Number);
}

/** Whether all numbers are finite and within bounds. */
function bounded(data: Float32Array): boolean {
  for (let at = 0; at < data.length; at++) if (!(Math.abs(data[at]!) <= FIELDS.LARGEST_NUMBER)) return false;
  return true;
}

/** Rows of all arrays, in a new order, with any repeated or left out. */
export function taken<T extends Numbers>(arrays: Record<string, NumberArray<T>>, order: number[]) {
  const reordered: Record<string, NumberArray<T>> = {};
  for (const [name, array] of Object.entries(arrays)) {
    const { data, shape } = array;
    if (order.length === shape[0] && order.every((row, at) => row === at)) {
      reordered[name] = array;
      continue;
    }
    const width = data.length / shape[0]!;
    const Same = data.constructor as new (length: number) => T;
    const picked = new Same(order.length * width);
    order.forEach((row, at) => {
      picked.set(data.subarray(row * width, (row + 1) * width) as unknown as ArrayLike<never>, at * width);
    });
    reordered[name] = { data: picked, shape: [order.length, ...shape.slice(1)] };
  }
  return reordered;
}
