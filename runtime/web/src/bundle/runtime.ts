/* ONNX Runtime, which is loaded with the first graph. */

export type Runtime = typeof import("onnxruntime-web/wasm");

let load = (): Promise<Runtime> => import("onnxruntime-web/wasm");

/** Load another build of it from now on. */
export function loadFrom(source: () => Promise<Runtime>): void {
  load = source;
}

export function loaded(): Promise<Runtime> {
  return load();
}
