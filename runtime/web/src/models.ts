import { Bundle } from "./bundle.js";
import { DescribeModel } from "./describe.js";
import { BundleError } from "./errors.js";
import { FillModel } from "./fill.js";
import { type GenerateModel, generateModel } from "./generate.js";
import type { Graph, SessionSettings } from "./graph.js";
import { PredictModel } from "./predict.js";
import { SearchModel } from "./search.js";

export type AnyModel = DescribeModel | GenerateModel | PredictModel | FillModel | SearchModel;

/** Load a bundle from an address or its bytes; BundleError where it is damaged or of a kind that is not run here. */
export async function load(source: string | URL | Uint8Array, settings?: SessionSettings): Promise<AnyModel> {
  const bundle = await Bundle.open(source instanceof Uint8Array ? source : await fetched(source));
  const { manifest } = bundle;
  const graphs: Record<string, Graph> = {};
  for (const role of Object.keys(manifest.graphs)) graphs[role] = await bundle.graph(role, settings);
  switch (manifest.loop) {
    case "beam":
    case "consensus":
      return new DescribeModel(manifest, graphs);
    case "codes":
      return generateModel(bundle, graphs);
    case "free_run":
      return new PredictModel(manifest, graphs);
    case "between":
      return new FillModel(manifest, graphs);
    case "nearest":
      return new SearchModel(manifest, graphs);
    default:
      throw new BundleError(`the bundle ${manifest.name} has the loop ${JSON.stringify(manifest.loop)}, which is not run here`);
  }
}

async function fetched(address: string | URL): Promise<Uint8Array> {
  const response = await fetch(address);
  if (!response.ok) throw new BundleError(`${address}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}
