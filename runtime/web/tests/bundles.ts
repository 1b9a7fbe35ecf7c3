import { readFile } from "node:fs/promises";

/** The bytes of a shipped bundle. */
export async function bundle(name: string): Promise<Uint8Array> {
  return new Uint8Array(await readFile(`../motet/bundles/${name}.zip`));
}
