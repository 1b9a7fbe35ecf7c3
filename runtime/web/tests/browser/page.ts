/* In a page: what became of each case, null for one that passed. */
import { cases } from "../cases.js";

const read = async (name: string) => new Uint8Array(await (await fetch(`/bundles/${name}.zip`)).arrayBuffer());

const found: Record<string, string | null> = {};
for (const { name, run } of cases) {
  found[name] = await run(read).then(() => null, (error: unknown) => String(error instanceof Error ? error.stack : error));
}
export default found;
