// Opens a report page from its file, points at its map all over and prints as JSON what it then tells.
import { pathToFileURL } from "node:url";

import { hues, open, options } from "./browser.mjs";

/** Places in each direction of the map at which is pointed. */
const PLACES = 16;

const chosen = options(["modules", "chromium", "page", "picture"]);
const { browser, page, errors } = await open(chosen);
try {
  const requests = [];
  page.on("request", (request) => requests.push(request.url()));
  await page.goto(pathToFileURL(chosen.page).href);
  await page.waitForFunction(() => document.documentElement.dataset.drawn != undefined);
  const map = page.locator("#height-map");
  const { width, height } = await map.boundingBox();
  const sections = ["section-across", "section-along"];
  const told = () =>
    page.evaluate(
      (ids) => ({
        readout: document.getElementById("readout").textContent,
        sections: ids.map((id) => document.querySelector(`#${id} canvas`).toDataURL().length),
      }),
      sections,
    );
  const points = [];
  for (let row = 0; row < PLACES; row++) {
    for (let column = 0; column < PLACES; column++) {
      const position = { x: ((column + 0.5) * width) / PLACES, y: ((row + 0.5) * height) / PLACES };
      await map.hover({ position });
      points.push({ ...(await told()), position });
    }
  }
  // The picture is of the highest place.
  const height_mm = ({ readout }) => Number(/z ([-\d.]+)/.exec(readout)?.[1] ?? -Infinity);
  const highest = points.reduce((a, b) => (height_mm(b) > height_mm(a) ? b : a));
  await map.hover({ position: highest.position });
  await page.screenshot({ path: chosen.picture, fullPage: true });
  const drawn = await page.evaluate(() => document.documentElement.dataset.drawn);
  const seen = { drawn, errors, requests: requests.length, map: await hues(page, map), points };
  process.stdout.write(`${JSON.stringify(seen)}\n`);
} finally {
  await browser.close();
}
