"use strict";

/**
 * A line of points of the map as a section: over x or y where it runs along one of them, else over its length from above.
 * Points stand in ascending order of their place.
 */
function section(map, values, points, chosen) {
  const [x, y, z] = values;
  const known = points.filter((i) => z[i] === z[i]);
  let length = 0;
  const lengths = known.map((i, at) => {
    if (at > 0) length += Math.hypot(x[i] - x[known[at - 1]], y[i] - y[known[at - 1]]);
    return length;
  });
  const extents = [x, y].map((values) => {
    const [low, high] = range(known.map((i) => values[i]));
    return known.length ? high - low : 0;
  });
  const straight = [0, 1].find((axis) => extents[axis] > 0.95 * length);
  // Where nothing was measured the curve has a gap, at a place between its neighbours.
  const at = new Map(known.map((i, order) => [i, straight === undefined ? lengths[order] : values[straight][i]]));
  const pairs = [];
  let last = null;
  let isGap = false;
  for (const i of points) {
    if (!at.has(i)) {
      isGap = last !== null;
      continue;
    }
    const here = at.get(i);
    if (isGap) pairs.push([(last + here) / 2, null]);
    pairs.push([here, z[i]]);
    [last, isGap] = [here, false];
  }
  pairs.sort((a, b) => a[0] - b[0]);
  const { label, unit } = straight === undefined ? { label: "along the line", unit: map.axes[0].unit } : map.axes[straight];
  return {
    at: pairs.map((pair) => pair[0]),
    z: pairs.map((pair) => pair[1]),
    mark: at.get(chosen),
    label: `${label} [${unit}]`,
  };
}

async function drawMap(map, plots) {
  const values = await unpack(map);
  const { rows, columns, row_step, column_step } = map.grid;
  const element = (id) => document.getElementById(id);
  const sections = ["section-across", "section-along"].map((id) => new Section(element(id), map));
  const select = (row, column) => {
    const point = row * columns + column;
    const across = Array.from({ length: columns }, (_, i) => row * columns + i);
    const along = Array.from({ length: rows }, (_, i) => i * columns + column);
    sections[0].show(section(map, values, across, point));
    sections[1].show(section(map, values, along, point));
    const place = map.axes.map(({ label, unit, digits }, axis) => `${label} ${values[axis][point].toFixed(digits)} ${unit}`);
    element("readout").textContent = `${place.join(" · ")} · profile ${row * row_step}, point ${column * column_step}`;
  };
  const heights = new HeightMap(element("height-map"), map, values, select);
  const inputs = [element("color-low"), element("color-high")];
  const original = heights.colors.slice();
  const apply = () => {
    const isFixed = heights.colors.some((end, i) => end !== original[i]);
    sections.forEach((section) => Object.assign(section, { colors: heights.colors, isFixed }));
    heights.draw();
    sections.forEach(({ plot }) => plot.redraw(true, true));
  };
  const fill = () => inputs.forEach((input, end) => (input.value = heights.colors[end].toFixed(map.axes[2].digits)));
  inputs.forEach((input, end) =>
    input.addEventListener("change", () => {
      const value = parseFloat(input.value);
      if (Number.isFinite(value)) heights.colors = heights.colors.map((old, i) => (i === end ? value : old));
      apply();
    }),
  );
  element("colors").addEventListener("submit", (event) => event.preventDefault());
  element("color-reset").addEventListener("click", () => {
    heights.colors = original.slice();
    fill();
    apply();
  });
  fill();
  apply();
  plots.push(...sections.map(({ plot }) => plot));
  heights.choose(heights.near(heights.box.left + heights.box.width / 2, heights.box.top + heights.box.height / 2));
  let width = heights.canvas.clientWidth;
  new ResizeObserver(() => {
    if (width !== (width = heights.canvas.clientWidth)) heights.draw();
  }).observe(heights.canvas);
  return heights;
}

async function main() {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const plots = data.charts.map(seriesChart);
  let heights = null;
  if (data.map) heights = await drawMap(data.map, plots);
  const frames = document.getElementById("frames");
  if (frames) {
    document.getElementById("show-lines").addEventListener("change", (event) => frames.classList.toggle("no-lines", !event.target.checked));
    document.getElementById("frame-zoom").addEventListener("input", (event) => frames.style.setProperty("--zoom", event.target.value));
  }
  const redraw = () => {
    plots.forEach((plot) => plot.redraw(false, true));
    if (heights) heights.paint();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  matchMedia("print").addEventListener("change", redraw);
  document.documentElement.dataset.drawn = "yes";
}

main().catch((error) => {
  document.documentElement.dataset.drawn = "no";
  const readout = document.getElementById("readout");
  if (readout) readout.textContent = `This page cannot be drawn: ${error}`;
  throw error;
});
