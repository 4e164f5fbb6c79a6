// Bundles the page into one HTML file: node build.mjs WASM_FOLDER OUT.html
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { readFile, writeFile } from "node:fs/promises";
import { join, resolve } from "node:path";
import { gzipSync } from "node:zlib";

const [wasmFolder, out] = process.argv.slice(2);
if (!wasmFolder || !out) {
  throw new Error("two arguments are needed: the folder of scope.js, and the page's file");
}

const shared = {
  bundle: true,
  write: false,
  minify: true,
  format: "iife",
  target: "es2022",
  jsx: "automatic",
  jsxImportSource: "preact",
  charset: "utf8",
  alias: { scope: resolve(wasmFolder, "scope.js") },
  // The WebAssembly is given to its start; no file is fetched beside the script.
  define: { "import.meta.url": '"about:blank"' },
  logLevel: "warning",
};

/** The text of a bundled script. */
async function bundle(entry, plugins = []) {
  const result = await build({ ...shared, entryPoints: [entry], plugins });
  return result.outputFiles[0].text;
}

/** Makes `import source from "worker"` the worker's script as text. */
function workerText(text) {
  return {
    name: "worker-text",
    setup(build) {
      build.onResolve({ filter: /^worker-script$/ }, () => ({ path: "worker-script", namespace: "text" }));
      build.onLoad({ filter: /.*/, namespace: "text" }, () => ({ contents: text, loader: "text" }));
    },
  };
}

const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;

const worker = await bundle("src/worker/main.ts");
const script = (await bundle("src/main.tsx", [workerText(worker)])).replaceAll("</script", "<\\/script");
const style = (await readFile("node_modules/uplot/dist/uPlot.min.css", "utf8")) + (await readFile("src/style.css", "utf8"));
const wasm = gzipSync(await readFile(join(wasmFolder, "scope_bg.wasm")), { level: 9 });

// uPlot and the moving picture set style attributes, which need no hash of a style sheet.
const policy = [
  "default-src 'none'",
  `script-src ${hash(script)} 'wasm-unsafe-eval'`,
  "worker-src blob:",
  `style-src ${hash(style)}`,
  "style-src-attr 'unsafe-inline'",
  "img-src data:",
  "connect-src 'self'",
  "base-uri 'none'",
  "form-action 'none'",
].join("; ");

const page = `<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="${policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Double-drive feed</title>
<link rel="icon" href="data:,">
<style>${style}</style>
</head>
<body>
<div id="page"></div>
<script type="application/wasm+gzip+base64" id="wasm">${wasm.toString("base64")}</script>
<script>${script}</script>
</body>
</html>
`;
await writeFile(out, page);
console.log(`${out}: ${page.length} bytes, ${gzipSync(page).length} compressed`);
