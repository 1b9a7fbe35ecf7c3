import { figures } from "./figures.js";

export default await figures(
  async (name) => new Uint8Array(await (await fetch(`/bundles/${name}.zip`)).arrayBuffer()),
);
