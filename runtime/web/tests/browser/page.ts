/* In a page: what became of each case, null for one that passed. */
import { load } from "../../src/index.js";
import { cases } from "../cases.js";

const read = async (name: string) =>
  new Uint8Array(await (await fetch(`/bundles/${name}.zip`)).arrayBuffer());

const found: Record<string, string | null> = {};
for (const { name, run } of cases) {
  found[name] = await run(read).then(
    () => null,
    (error: unknown) => String(error instanceof Error ? error.stack : error),
  );
}
/** What is said of a bundle on a server that does not allow this page to read it: the same one, by another name. */
const elsewhere = await load(`http://127.0.0.1:${location.port}/bundles/predict.zip`).then(() => "", String);

export default { found, elsewhere };
