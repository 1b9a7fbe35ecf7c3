import { BUNDLE, MANIFEST, MEMBERS } from "../generated.js";
import { type NumberArray, DTYPES, readNpy, readNpz } from "./arrays.js";
import { BundleError } from "../errors.js";
import { type GraphSpec, Graph, type SessionSettings } from "./graph.js";
import { checkManifest, isObject } from "./manifest.js";
import { type Archive, hexOf, joined, openZip } from "./members.js";

/** manifest.json, as docs/reference/bundle.md describes it. */
export interface Manifest {
  format: number;
  name: string;
  version: string;
  verb: string;
  model: string;
  loop: string;
  files: Record<string, { sha256: string; size: number }>;
  graphs: Record<string, GraphSpec & { file: string; weights?: string }>;
  tables: Record<string, { file: string; dtype: string; shape: number[] }>;
  golden: { file: string; tolerance: number; run: Record<string, number | string> };
  motion: {
    representation: string;
    channels: string[];
    units: string[];
    fps: number;
    mean: number[];
    std: number[];
    skeleton: { joints: { name: string; parent: number; offset: number[] }[]; metres_per_unit: number };
  };
  defaults: Record<string, number>;
  settings: Record<string, Record<string, number>>;
  config: Record<string, unknown>;
  text?: TextTables;
  vocabulary?: string[];
  common?: Record<string, string>;
  actions?: { sentence: string; words: string[] }[];
  commands?: { sentence: string; action: number; texts: string[]; instead: string[] }[];
  licence: { weights: string | null; data: string | null };
}

/** The tables of a bundle's rules of text. */
export interface TextTables {
  rules: number;
  dropped: string;
  spelling: Record<string, string>;
  numbers: Record<string, number>;
  hundred: string;
  conjunction: string;
  point: string;
  spelled: number;
}

/** A bundle whose files are checked against its manifest as they are read. */
export class Bundle {
  private constructor(
    readonly manifest: Manifest,
    private readonly zip: Archive,
  ) {}

  /** Open the bytes of a bundle's zip; BundleError says what is wrong with it. */
  static async open(bytes: Uint8Array): Promise<Bundle> {
    const zip = openZip(bytes);
    const manifest = parse(await zip.read("manifest.json", BUNDLE.MAX_MANIFEST));
    const listed = Object.keys(manifest.files);
    const extra = zip.names.filter((name) => name !== "manifest.json" && !listed.includes(name));
    if (extra.length) throw new BundleError(`not in its manifest: ${extra.join(", ")}`);
    if (listed.length > MEMBERS.MAX_FILES)
      throw new BundleError(`the bundle has more than ${MEMBERS.MAX_FILES} files`);
    return new Bundle(manifest, zip);
  }

  /** One file, whose size and sha256 are those of the manifest. */
  async read(name: string): Promise<Uint8Array> {
    const entry = this.manifest.files[name];
    if (!entry) throw new BundleError(`the file ${JSON.stringify(name)} is not in the manifest`);
    if (!(entry.size <= MEMBERS.MAX_SIZE))
      throw new BundleError(`${name} has ${entry.size} bytes; at most ${MEMBERS.MAX_SIZE} are read`);
    const bytes = await this.zip.read(name, entry.size);
    const hash = await crypto.subtle.digest("SHA-256", bytes as BufferSource);
    if (bytes.length !== entry.size || hexOf(new Uint8Array(hash)) !== entry.sha256)
      throw new BundleError(`the file ${name} was altered`);
    return bytes;
  }

  /** The graph of a role, loaded by ONNX Runtime. */
  async graph(role: string, settings?: SessionSettings): Promise<Graph> {
    const spec = this.manifest.graphs[role];
    if (!spec) throw new BundleError(`the bundle ${this.manifest.name} has no graph ${JSON.stringify(role)}`);
    // behind a graph come the weights that it shares with others: protocol buffers merge
    const files = spec.weights === undefined ? [spec.file] : [spec.file, spec.weights];
    const parts = await Promise.all(files.map((file) => this.read(file)));
    return Graph.load(role, joined(parts), spec, settings);
  }

  /** A plain array. */
  async table(name: string): Promise<NumberArray> {
    const entry = this.manifest.tables[name];
    if (!entry)
      throw new BundleError(`the bundle ${this.manifest.name} has no table ${JSON.stringify(name)}`);
    const array = readNpy(entry.file, await this.read(entry.file));
    if (array.descr !== DTYPES[entry.dtype] || `${array.shape}` !== `${entry.shape}`) {
      throw new BundleError(
        `table ${name} is ${array.descr} (${array.shape}), not ${entry.dtype} (${entry.shape})`,
      );
    }
    if (array.data.some((value) => typeof value === "number" && !Number.isFinite(value))) {
      throw new BundleError(`table ${name} has numbers that are not finite`);
    }
    return array;
  }

  /** The golden vectors by name. */
  async golden(): Promise<Map<string, NumberArray>> {
    return readNpz(await this.read(this.manifest.golden.file), MEMBERS.MAX_SIZE);
  }
}

function parse(bytes: Uint8Array): Manifest {
  let manifest: unknown;
  try {
    manifest = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes));
  } catch {
    throw new BundleError("manifest.json is not JSON");
  }
  if (!isObject(manifest) || !("format" in manifest))
    throw new BundleError("manifest.json is not a bundle's manifest");
  if (manifest.format !== MANIFEST.FORMAT)
    throw new BundleError(`this is a bundle of format ${manifest.format}; format ${MANIFEST.FORMAT} is read`);
  checkManifest(manifest);
  return manifest as unknown as Manifest;
}
