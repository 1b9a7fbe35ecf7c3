import type { Bundle, Manifest } from "./bundle.js";
import { drawCodes, drawnAction, type Drawing, type Source } from "./codes.js";
import { framesOf } from "./decodeCodes.js";
import type { Graph } from "./graph.js";
import { Memory } from "./memory.js";
import { LanguageModel } from "./model.js";
import { type Noise, Pcg64 } from "./random.js";

export interface GenerateSettings extends Partial<Drawing> {
  seed?: number;
  hypotheses?: number;
  /** The exact length; by default a motion ends by itself. */
  seconds?: number;
  max_seconds?: number;
}

/** Motions for a sentence, drawn as codes. */
export class GenerateModel extends LanguageModel {
  constructor(
    manifest: Manifest,
    private readonly graphs: Record<string, Graph>,
    private readonly source: Source,
  ) {
    super(manifest);
  }

  /** Motions as frames (T, D) of `root_sixd`: those that Python draws with the same seed, before feet are held. */
  async generate(text: string, settings: GenerateSettings = {}): Promise<Float32Array[][]> {
    const seed = this.setting("seed", settings.seed ?? 0);
    const count = this.setting("hypotheses", settings.hypotheses ?? 1);
    const noise = Array.from({ length: count }, (_, at) => (at ? new Pcg64(seed, at - 1) : new Pcg64(seed)));
    return this.drawn(text, noise, settings);
  }

  /** The same by noise that is given for each motion. */
  async drawn(text: string, noise: Noise[], given: GenerateSettings): Promise<Float32Array[][]> {
    const drawing: Drawing = {
      temperature: this.setting("temperature", given.temperature),
      first_temperature: this.setting("first_temperature", given.first_temperature),
      top_p: this.setting("top_p", given.top_p),
      guidance: this.setting("guidance", given.guidance),
      memory: this.setting("memory", given.memory),
      certainty: this.setting("certainty", given.certainty),
    };
    const seconds = given.seconds === undefined ? 0 : this.setting("seconds", given.seconds);
    const { shape } = this.graphs.decoder!.spec.outputs.find((output) => output.name === "frames")!;
    const steps = Math.ceil(((seconds || this.setting("max_seconds", given.max_seconds)) * this.fps) / Number(shape[2]) - 1e-9);
    const { context } = await this.graphs.encoder!.run(this.words(text));
    const actions = noise.map((one) => drawnAction(this.source, context!.data, one, drawing.certainty));
    const codes = await drawCodes(this.source, actions, noise, drawing, Math.max(1, steps), seconds > 0);
    const motions: Float32Array[][] = [];
    for (const one of codes) {
      const frames = await framesOf(this.graphs.decoder!, one, this.fps);
      motions.push(seconds ? frames.slice(0, Math.max(1, Math.round(seconds * this.fps))) : frames);
    }
    return motions;
  }
}

/** What a bundle's codes are drawn from. */
export async function sourceOf(bundle: Bundle, { step, part }: Record<string, Graph>): Promise<Source> {
  const tables = await Promise.all(["memory", "moves", "body"].map((name) => bundle.table(name)));
  const [memory, moves, body] = tables as [typeof tables[0], typeof tables[0], typeof tables[0]];
  const actions = bundle.manifest.actions?.length ?? 0;
  const parts = Number(part!.spec.inputs.find((input) => input.name === "codes")!.shape[1]);
  return { step: step!, part: part!, end: moves.shape[0]!, nullAction: actions, parts, memory: new Memory(memory, moves, body, actions) };
}
