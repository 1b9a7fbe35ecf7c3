/* Every graph and every run of the shipped bundles gives Python's answers, in Chromium. */
import assert from "node:assert/strict";
import test, { before } from "node:test";
import { cases } from "../cases.js";
import { inChromium } from "./chromium.js";

let page: { found: Record<string, string | null>; elsewhere: string };
before(async () => {
  page = (await inChromium("page.js")) as typeof page;
});

for (const { name } of cases) test(`${name}, in Chromium`, () => assert.equal(page.found[name], null));

test("a bundle of another origin is refused by name, in Chromium", () => {
  assert.match(page.elsewhere, /^BundleError: http:.*predict\.zip cannot be fetched .*CORS/);
});
