/* Every graph and every run of the shipped bundles gives Python's answers, in Chromium. */
import assert from "node:assert/strict";
import test, { before } from "node:test";
import { cases } from "../cases.js";
import { inChromium } from "./chromium.js";

let found: Record<string, string | null>;
before(async () => {
  found = (await inChromium("page.js")) as typeof found;
});

for (const { name } of cases) test(`${name}, in Chromium`, () => assert.equal(found[name], null));
