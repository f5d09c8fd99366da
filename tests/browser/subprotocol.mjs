// Foxglove 1.48 asks a live view for `foxglove.websocket.v1`, an earlier name of `foxglove.sdk.v1`, and is refused. What
// it asks for and what it is answered is renamed here; everything behind the handshake passes as it is.
import { connect, createServer } from "node:net";

const [OLD, NEW] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];
const END_OF_HEAD = "\r\n\r\n";

/**
 * Listens for a page on a free port and speaks to the view at `url` (`ws://…`), until `close()`.
 *
 * @returns {Promise<{url: string, close: () => void}>}
 */
export async function renamed(url) {
  const { hostname, port } = new URL(url);
  const server = createServer((page) => {
    const view = connect(Number(port), hostname);
    forward(page, view, OLD, NEW);
    forward(view, page, NEW, OLD);
  });
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  return { url: `ws://127.0.0.1:${server.address().port}`, close: () => server.close() };
}

/** Hands on what comes, with one word of the head exchanged. */
function forward(from, to, word, other) {
  let head = "";
  const inHead = (bytes) => {
    head += bytes.toString("latin1");
    const end = head.indexOf(END_OF_HEAD);
    if (end >= 0) {
      from.off("data", inHead);
      to.write(head.slice(0, end).replace(word, other) + head.slice(end), "latin1");
      from.pipe(to);
    }
  };
  from.on("data", inHead);
  for (const [one, both] of [[from, to], [to, from]]) {
    one.on("error", () => both.destroy());
  }
}
