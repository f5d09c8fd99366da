// Opens a recording or a live view in Foxglove 1.48, the last open version, with a layout that this project ships, lets
// some seconds of it pass and prints as JSON what there is to see: topics, and of each panel its text and colours.
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

import { hues, open, options } from "./browser.mjs";
import { serve } from "./serve.mjs";
import { renamed } from "./subprotocol.mjs";

/** Longest wait for the page or the recording, milliseconds: software rendering on a busy machine. */
const PATIENCE_MS = 120_000;
/** How often a recording is opened until the panels have something to show. */
const ATTEMPTS = 3;

/**
 * The layout in the words of 1.48, which calls the image panel and its settings otherwise. Newer versions translate in
 * the other direction when they import an old layout.
 */
function inWordsOf148(layout) {
  const renamed = JSON.parse(JSON.stringify(layout).replaceAll('"Image!', '"ImageViewPanel!'));
  for (const [id, panel] of Object.entries(renamed.configById)) {
    if (id.startsWith("ImageViewPanel!")) {
      const { imageTopic, annotations = {} } = panel.imageMode;
      const shown = Object.keys(annotations).filter((topic) => annotations[topic].visible);
      Object.assign(panel, { cameraTopic: imageTopic, enabledMarkerTopics: shown, synchronize: false, mode: "fit" });
    }
  }
  return renamed;
}

/** Names and types of the topics, as the side bar lists them. */
async function topics(page) {
  const lines = (await page.locator("body").innerText()).split("\n");
  const isTopic = (line, at) => /^(\/\w+)+$/.test(line) && /^\w+\/msg\/\w+$/.test(lines[at + 1] ?? "");
  return Object.fromEntries(lines.flatMap((line, at) => (isTopic(line, at) ? [[line, lines[at + 1]]] : [])));
}

/** Plays until `seconds` after the start of the recording. */
async function play(page, seconds) {
  const clock = page.getByTestId("PlaybackTime-text").locator("input");
  const now = async () => {
    const [, hour, minute, second] = /(\d+):(\d+):([\d.]+)/.exec(await clock.inputValue());
    return Number(hour % 12) * 3600 + Number(minute) * 60 + Number(second);
  };
  const start = await now();
  const limit = Date.now() + PATIENCE_MS;
  await page.locator("body").press("Space");
  while ((await now()) - start < seconds && Date.now() < limit) {
    await page.waitForTimeout(50);
  }
  await page.locator("body").press("Space");
}

/** Opens a source and closes the side bar; what that listed. */
async function arrive(page, address) {
  await page.goto(address);
  await page.getByText("sensor_msgs/msg/Image").or(page.getByText(/^Problems\s*\d+$/)).first().waitFor();
  const seen = { topics: await topics(page), problems: await page.getByText(/^Problems\s*\d+$/).count() };
  // What is left is what the layout is about.
  await page.getByTitle("Data source").click();
  return seen;
}

/** Whether nothing has come through to a panel whose topic every recording has. */
async function isWaiting(page) {
  const health = page.locator('[data-testid="panel-mouseenter-container DiagnosticSummary!health"]');
  return (await health.innerText()).includes("Waiting for");
}

/**
 * Plays a recording from its start. On a busy machine 1.48 may let the time run and hand on nothing: then the recording is
 * opened anew.
 */
async function playThrough(page, address, seconds) {
  for (let attempt = 1; ; attempt += 1) {
    const seen = await arrive(page, address);
    await play(page, seconds);
    // What was read last is drawn.
    await page.waitForTimeout(1500);
    if (attempt === ATTEMPTS || !(await isWaiting(page))) {
      return seen;
    }
    await page.evaluate(() => localStorage.clear());
  }
}

/** Text and colours of the panels that are visible. */
async function panels(page) {
  const found = {};
  for (const element of await page.locator('[data-testid^="panel-mouseenter-container "]').all()) {
    const id = (await element.getAttribute("data-testid")).split(" ")[1];
    found[id] = { text: await element.innerText(), hues: await hues(page, element) };
  }
  return found;
}

const chosen = options(["modules", "chromium", "source", "layout", "seconds", "picture"]);
const place = await mkdtemp(join(tmpdir(), "foxglove-"));
const layout = join(place, "layout.json");
await writeFile(layout, JSON.stringify(inWordsOf148(JSON.parse(await readFile(chosen.layout, "utf8")))));
const live = chosen.source.startsWith("ws:") ? await renamed(chosen.source) : undefined;
const here = dirname(fileURLToPath(import.meta.url));
const server = await serve({
  page: here,
  modules: chosen.modules,
  "layout.json": layout,
  ...(live ? {} : { "recording.mcap": chosen.source }),
});
const { browser, page, errors } = await open(chosen);
try {
  page.setDefaultTimeout(PATIENCE_MS);
  const [kind, url] = live ? ["foxglove-websocket", live.url] : ["remote-file", `${server.origin}/recording.mcap`];
  const address = `${server.origin}/page/studio.html?${new URLSearchParams({ ds: kind, "ds.url": url })}`;
  const seconds = Number(chosen.seconds);
  let seen;
  if (live) {
    seen = await arrive(page, address);
    await page.waitForTimeout(1000 * seconds);
  } else {
    seen = await playThrough(page, address, seconds);
  }
  await page.mouse.move(0, 899);
  await page.screenshot({ path: chosen.picture });
  process.stdout.write(`${JSON.stringify({ ...seen, panels: await panels(page), errors })}\n`);
} finally {
  await browser.close();
  server.close();
  live?.close();
  await rm(place, { recursive: true });
}
