// The Rust code: compiled once, started on the page for what the plots compute and in the worker for the drive.

import { initSync } from "scope";

async function inflate(base64: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

export async function start(): Promise<WebAssembly.Module> {
  const element = document.getElementById("wasm");
  const module = await WebAssembly.compile(await inflate(element?.textContent ?? ""));
  initSync({ module });
  return module;
}
