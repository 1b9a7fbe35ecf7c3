/* Every graph and every run of the shipped bundles gives Python's answers, in Node. */
import { readFile } from "node:fs/promises";
import test from "node:test";
import { cases } from "./cases.js";

const read = async (name: string) => new Uint8Array(await readFile(`../motet/bundles/${name}.zip`));

for (const one of cases) test(one.name, () => one.run(read));
