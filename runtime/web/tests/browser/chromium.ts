/* Runs a built script in headless Chromium, from a server of its own, and gives what the script reports. */
import { spawn } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { createServer, type IncomingMessage, type Server } from "node:http";
import { tmpdir } from "node:os";
import { delimiter, extname, join } from "node:path";
import { accessSync, constants } from "node:fs";

const NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];
const TYPES: Record<string, string> = {
  ".js": "text/javascript",
  ".mjs": "text/javascript",
  ".wasm": "application/wasm",
};
const SECONDS = 180;

/** The browser that CHROME_PATH names, or the first one on the PATH. */
function browser(): string {
  const places = (process.env.PATH ?? "")
    .split(delimiter)
    .flatMap((folder) => NAMES.map((name) => join(folder, name)));
  for (const place of process.env.CHROME_PATH ? [process.env.CHROME_PATH] : places) {
    try {
      accessSync(place, constants.X_OK);
      return place;
    } catch {
      // the next one
    }
  }
  throw new Error(
    `no Chromium at ${process.env.CHROME_PATH ?? "any place of PATH"}: install one, or name it in CHROME_PATH`,
  );
}

const page = (script: string) => `<!doctype html><meta charset="utf-8">
<script type="importmap">{"imports": {"onnxruntime-web/wasm": "/node_modules/onnxruntime-web/dist/ort.wasm.bundle.min.mjs"}}</script>
<script>
  const report = (result) => fetch("/report", { method: "POST", body: JSON.stringify(result) });
  addEventListener("error", (event) => report({ error: event.message }));
  addEventListener("unhandledrejection", (event) => report({ error: String(event.reason?.stack ?? event.reason) }));
</script>
<script type="module">import result from "/build/${script}"; report({ result });</script>`;

/** What a module of build/ exports by default, as JSON, once it has run in Chromium. */
export async function inChromium(script: string): Promise<unknown> {
  const program = browser();
  const profile = await mkdtemp(join(tmpdir(), "motet-chromium-"));
  const { server, reported } = await served(script);
  const { port } = server.address() as { port: number };
  const root = process.getuid?.() === 0 ? ["--no-sandbox"] : [];
  const flags = [
    "--headless=new",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    `--user-data-dir=${profile}`,
    ...root,
  ];
  const child = spawn(program, [...flags, `http://localhost:${port}/`], { stdio: "ignore", detached: true });
  const ended = new Promise<never>((_, fail) => {
    child
      .on("error", fail)
      .on("exit", (code) => fail(new Error(`Chromium ended with ${code} before the page had reported`)));
    setTimeout(() => fail(new Error(`the page did not report within ${SECONDS} s`)), SECONDS * 1000).unref();
  });
  try {
    const { result, error } = (await Promise.race([reported, ended])) as { result?: unknown; error?: string };
    if (error) throw new Error(error);
    return result;
  } finally {
    const gone = new Promise((done) => child.once("exit", done));
    if (child.pid && child.exitCode === null) process.kill(-child.pid);
    await gone;
    server.close();
    server.closeAllConnections();
    await rm(profile, { recursive: true, force: true, maxRetries: 5 });
  }
}

/** A server of the page, of this folder, and of the bundles; and what is posted to it. */
async function served(script: string): Promise<{ server: Server; reported: Promise<unknown> }> {
  let tell: (given: unknown) => void;
  const reported = new Promise((done) => (tell = done));
  const server = createServer(async (request, response) => {
    if (request.method === "POST") tell(JSON.parse(await body(request)));
    const path = new URL(request.url!, "http://localhost").pathname;
    const file = path.startsWith("/bundles/") ? `../motet${path}` : `.${path}`;
    const found = path === "/" ? page(script) : await readFile(file).catch(() => null);
    // what lets a page have threads
    const headers = {
      "Cross-Origin-Opener-Policy": "same-origin",
      "Cross-Origin-Embedder-Policy": "require-corp",
    };
    response
      .writeHead(found ? 200 : 404, { ...headers, "Content-Type": TYPES[extname(path)] ?? "text/html" })
      .end(found ?? "");
  });
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  return { server, reported };
}

async function body(request: IncomingMessage): Promise<string> {
  let text = "";
  for await (const part of request) text += part;
  return text;
}
