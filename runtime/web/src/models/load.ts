import { Bundle } from "../bundle/bundle.js";
import { type ControlModel, controlModel } from "../steering/model.js";
import { DescribeModel } from "./describe.js";
import { BundleError } from "../errors.js";
import { FillModel } from "../predict/fill.js";
import { type GenerateModel, generateModel } from "../generate/model.js";
import type { Graph, SessionSettings } from "../bundle/graph.js";
import { Known } from "./nearestNeighbour.js";
import { PredictModel } from "../predict/model.js";
import { SearchModel } from "../search/model.js";

/** The graphs that a loop cannot do without. */
const ROLES: Record<string, string[]> = {
  beam: ["encoder", "step"],
  consensus: ["encoder", "step"],
  codes: ["encoder", "step", "part", "decoder", "tokens"],
  free_run: ["encoder", "step"],
  between: ["filler"],
  matching: [],
  nearest: ["motion", "text"],
};

export type AnyModel = ControlModel | DescribeModel | GenerateModel | PredictModel | FillModel | SearchModel;

/** The graphs of each model that is loaded. */
const loadedGraphs = new WeakMap<AnyModel, Graph[]>();

/** Give back the memory that ONNX Runtime holds for a model, which is of no use then; without it, it stays until the page goes. */
export async function release(model: AnyModel): Promise<void> {
  await Promise.all((loadedGraphs.get(model) ?? []).map((graph) => graph.release()));
  loadedGraphs.delete(model);
}

/**
 * Load a bundle from an address, its bytes or, in Node, a path; BundleError where it cannot be read, is damaged, or of a
 * kind that is not run here or not the one that is wanted: `load("generate.zip", GenerateModel)`.
 */
export async function load<T extends AnyModel = AnyModel>(
  source: string | URL | Uint8Array,
  kind?: new (...parameters: never[]) => T,
  settings?: SessionSettings,
): Promise<T> {
  const bytes = source instanceof Uint8Array ? source : await fetched(source);
  const graphs: Record<string, Graph> = {};
  try {
    const model = await loaded(await Bundle.open(bytes), graphs, settings);
    loadedGraphs.set(model, Object.values(graphs));
    if (kind && !(model instanceof kind))
      throw new BundleError(
        `the bundle ${model.manifest.name} is for ${model.manifest.verb}: it is no ${kind.name}`,
      );
    return model as T;
  } catch (error) {
    await Promise.all(Object.values(graphs).map((graph) => graph.release()));
    // a manifest of the wrong form shows in many ways
    throw error instanceof BundleError
      ? error
      : new BundleError(`the bundle's manifest is damaged: ${String(error)}`);
  }
}

async function loaded(
  bundle: Bundle,
  graphs: Record<string, Graph>,
  settings?: SessionSettings,
): Promise<AnyModel> {
  const { manifest } = bundle;
  const known = Object.keys(manifest.graphs);
  for (const role of new Set([...(ROLES[manifest.loop] ?? []), ...known]))
    graphs[role] = await bundle.graph(role, settings);
  switch (manifest.loop) {
    case "beam":
    case "consensus":
      return new DescribeModel(manifest, graphs, await Known.of(bundle));
    case "codes":
      return generateModel(bundle, graphs);
    case "free_run":
      return new PredictModel(manifest, graphs);
    case "between":
      return new FillModel(manifest, graphs);
    case "matching":
      return controlModel(bundle);
    case "nearest":
      return new SearchModel(manifest, graphs);
    default:
      throw new BundleError(
        `the bundle ${manifest.name} has the loop ${JSON.stringify(manifest.loop)}, which is not run here`,
      );
  }
}

async function fetched(address: string | URL): Promise<Uint8Array> {
  const isPath =
    typeof process !== "undefined" && process.versions?.node && !/^(https?|data|blob):/.test(String(address));
  if (isPath) return readFile(address);
  const response = await fetch(address).catch((error: unknown) => {
    const allowed = "a page may fetch from where it comes from itself, and from servers that allow it (CORS)";
    throw new BundleError(`${address} cannot be fetched (${String(error)}): ${allowed}`);
  });
  if (!response.ok) throw new BundleError(`${address}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}

/** The bytes of a file, in Node. */
async function readFile(path: string | URL): Promise<Uint8Array> {
  const module = "node:fs/promises"; // by a name that no bundler of pages looks for
  const { readFile } = (await import(module)) as typeof import("node:fs/promises");
  const file = String(path).startsWith("file:") ? new URL(path) : path;
  return new Uint8Array(
    await readFile(file).catch((error: unknown) => {
      throw new BundleError(`${path} cannot be read: ${String(error)}`);
    }),
  );
}
