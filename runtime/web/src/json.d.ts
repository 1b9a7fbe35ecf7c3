/* Tables of the Python package, which esbuild bundles. */
declare module "*.json" {
  const content: unknown;
  export default content;
}
