import { Bundle } from "./bundle.js";
import { type ControlModel, controlModel } from "./control.js";
import { DescribeModel } from "./describe.js";
import { BundleError } from "./errors.js";
import { FillModel } from "./fill.js";
import { type GenerateModel, generateModel } from "./generate.js";
import type { Graph, SessionSettings } from "./graph.js";
import { Known } from "./known.js";
import { PredictModel } from "./predict.js";
import { SearchModel } from "./search.js";

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

/**
 * Load a bundle from an address or its bytes; BundleError where it cannot be fetched, is damaged, or of a kind that is
 * not run here or not the one that is asked for: `load("generate.zip", GenerateModel)`.
 */
export async function load<T extends AnyModel = AnyModel>(
  source: string | URL | Uint8Array, kind?: new (...given: never[]) => T, settings?: SessionSettings,
): Promise<T> {
  const bytes = source instanceof Uint8Array ? source : await fetched(source);
  const model = await Bundle.open(bytes).then((bundle) => loaded(bundle, settings)).catch((error: unknown) => {
    // a manifest of the wrong form shows in many ways
    throw error instanceof BundleError ? error : new BundleError(`the bundle's manifest is damaged: ${String(error)}`);
  });
  if (kind && !(model instanceof kind)) throw new BundleError(`the bundle ${model.manifest.name} is for ${model.manifest.verb}: it is no ${kind.name}`);
  return model as T;
}

async function loaded(bundle: Bundle, settings?: SessionSettings): Promise<AnyModel> {
  const { manifest } = bundle;
  const graphs: Record<string, Graph> = {};
  const known = Object.keys(manifest.graphs);
  for (const role of new Set([...(ROLES[manifest.loop] ?? []), ...known])) graphs[role] = await bundle.graph(role, settings);
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
      throw new BundleError(`the bundle ${manifest.name} has the loop ${JSON.stringify(manifest.loop)}, which is not run here`);
  }
}

async function fetched(address: string | URL): Promise<Uint8Array> {
  const response = await fetch(address).catch((error: unknown) => {
    const allowed = "a page may fetch from where it comes from itself, and from servers that allow it (CORS)";
    throw new BundleError(`${address} cannot be fetched (${String(error)}): ${allowed}`);
  });
  if (!response.ok) throw new BundleError(`${address}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}
