/* npm run bench: the figures in Node, and in Chromium. */
import { bundle } from "../bundles.js";
import { inChromium } from "../browser/chromium.js";
import { figures, type Times } from "./figures.js";

const print = (where: string, times: Times) => {
  for (const [what, { first, median, least }] of Object.entries(times)) {
    const numbers = [first, median, least].map((one) => one.toFixed(1).padStart(8)).join("");
    console.log(`${where.padEnd(10)}${what.padEnd(14)}${numbers}`);
  }
};
console.log(`${"".padEnd(24)}${["first", "median", "least"].map((one) => one.padStart(8)).join("")}   ms`);
print("Chromium", (await inChromium("page.js")) as Times);
print("Node", await figures(bundle));
