/* Every graph and every run of the shipped bundles gives Python's answers, in Node. */
import test from "node:test";
import { bundle } from "./bundles.js";
import { cases } from "./cases.js";

for (const one of cases) test(one.name, () => one.run(bundle));
