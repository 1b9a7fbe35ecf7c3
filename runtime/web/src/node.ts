/* What Node imports: the same functions, with ONNX Runtime's build for Node. */
import { loadFrom } from "./bundle/runtime.js";

loadFrom(() => import("onnxruntime-web"));

export * from "./index.js";
