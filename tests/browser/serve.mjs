// A small file server on loopback with Range, which a viewer needs to read a recording piece by piece.
import { createReadStream } from "node:fs";
import { stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".mjs": "text/javascript",
  ".json": "application/json",
  ".wasm": "application/wasm",
};

/**
 * Serves files until `close()`.
 *
 * @param {Record<string, string>} places Path of a file or directory by the first part of the URL's path.
 * @returns {Promise<{origin: string, close: () => void}>} The port is a free one.
 */
export async function serve(places) {
  const server = createServer((request, response) => {
    answer(places, request, response).catch(() => response.writeHead(404).end());
  });
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  const close = () => {
    server.close();
    server.closeAllConnections();
  };
  return { origin: `http://127.0.0.1:${server.address().port}`, close };
}

async function answer(places, request, response) {
  const [, first, ...rest] = normalize(decodeURI(new URL(request.url, "http://x").pathname)).split("/");
  const path = join(places[first], ...rest);
  const { size } = await stat(path);
  const headers = { "Content-Type": TYPES[extname(path)] ?? "application/octet-stream", "Accept-Ranges": "bytes" };
  const range = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? "");
  const start = range ? Number(range[1]) : 0;
  const end = range?.[2] ? Math.min(Number(range[2]), size - 1) : size - 1;
  if (range) {
    headers["Content-Range"] = `bytes ${start}-${end}/${size}`;
  }
  response.writeHead(range ? 206 : 200, { ...headers, "Content-Length": end - start + 1 });
  if (request.method === "HEAD") {
    response.end();
  } else {
    createReadStream(path, { start, end }).pipe(response);
  }
}
