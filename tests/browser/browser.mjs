// What every check of a page needs: Chromium without a screen, arguments, and what is seen in a picture.
import { createRequire } from "node:module";
import { join } from "node:path";
import { parseArgs } from "node:util";

/** Arguments of the form `--name value`; all of `names` must be given, and no other. */
export function options(names) {
  const { values } = parseArgs({ options: Object.fromEntries(names.map((name) => [name, { type: "string" }])) });
  const missing = names.filter((name) => values[name] == undefined);
  if (missing.length > 0) {
    throw new Error(`missing: ${missing.map((name) => `--${name}`).join(" ")}`);
  }
  return values;
}

/**
 * Opens Chromium with a page; WebGL is drawn by the processor.
 *
 * @param {{modules: string, chromium: string}} tools Where the packages of package.json are, and the program.
 * @returns The browser, the page, and what the page complains of, which grows.
 */
export async function open({ modules, chromium }) {
  const playwright = createRequire(join(modules, "here.js"))("playwright-core");
  const browser = await playwright.chromium.launch({
    executablePath: chromium,
    // Without a sandbox, as containers that run as root want it: only our own pages are opened.
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  return { browser, page, errors };
}

/**
 * What is seen of an element: how many pixels of each strong colour, by hue in steps of 30 degrees (0 red, 120 green,
 * 240 blue). Text, grids and grey images have none.
 */
export async function hues(page, element) {
  const picture = (await element.screenshot()).toString("base64");
  return page.evaluate(async (data) => {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data: pixels } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    const counts = {};
    for (let at = 0; at < pixels.length; at += 4) {
      const [red, green, blue] = pixels.subarray(at, at + 3);
      const most = Math.max(red, green, blue);
      const range = most - Math.min(red, green, blue);
      if (most < 80 || range < 0.5 * most) {
        continue;
      }
      const turn =
        most === red ? (green - blue) / range : most === green ? 2 + (blue - red) / range : 4 + (red - green) / range;
      const hue = (30 * Math.round(2 * turn) + 360) % 360;
      counts[hue] = (counts[hue] ?? 0) + 1;
    }
    return counts;
  }, picture);
}
