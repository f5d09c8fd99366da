"use strict";

/** The colour of that name in the page's present dress. */
function ink(name) {
  return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
}

/** x, y and z of every point in the unit of its axis, NaN where nothing was measured. See the program's `report::pack`. */
async function unpack(map) {
  const text = document.getElementById("map-data").textContent.trim();
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const { rows, columns, missing, scales } = map.grid;
  const length = rows * columns;
  return scales.map((scale, axis) => {
    const low = bytes.subarray(2 * axis * length);
    const high = low.subarray(length);
    const codes = new Int16Array(length);
    const values = new Float32Array(length);
    for (let i = 0; i < length; i++) {
      // An Int16Array takes sums modulo 2^16.
      codes[i] = (low[i] | (high[i] << 8)) + (i < columns ? 0 : codes[i - columns]);
      values[i] = codes[i] === missing ? NaN : map.axes[axis].factor * (scale.offset + scale.step * codes[i]);
    }
    return values;
  });
}

/** The median distance of points that are `step` places apart, along one axis. */
function pitch(values, step) {
  const distances = [];
  const stride = Math.max(1, Math.floor(values.length / 20000)) | 1;
  for (let i = step; i < values.length; i += stride) {
    const distance = Math.abs(values[i] - values[i - step]);
    if (distance >= 0) distances.push(distance);
  }
  distances.sort((a, b) => a - b);
  return distances[distances.length >> 1] || 0;
}

/** An axis in words, with its unit where it has one. */
function titled({ label, unit }) {
  return unit ? `${label} [${unit}]` : label;
}

function range(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low > high ? [0, 1] : [low, high];
}

/** Round numbers between two others, about `count` of them. */
function ticks([low, high], count) {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough || 1));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) found.push([i * step, (i * step).toFixed(digits)]);
  return found;
}

/** Points seen from above, in the colours of their heights. `select(row, column)` receives the point under the pointer. */
class HeightMap {
  constructor(canvas, map, values, select) {
    Object.assign(this, { canvas, map, values, select });
    this.columns = map.grid.columns;
    this.ranges = values.slice(0, 2).map(range);
    this.half = [0, 1].map((axis) => 0.52 * Math.max(pitch(values[axis], 1), pitch(values[axis], this.columns)));
    this.ranges = this.ranges.map(([low, high], axis) => {
      const half = this.half[axis] || 0.5;
      return [low - half, high + half];
    });
    const length = this.ranges.map(([low, high]) => high - low);
    // The longer side lies across the page.
    this.across = map.is_metric && length[1] > length[0] ? 1 : 0;
    this.colors = map.grid.colors.map((value) => value * map.axes[2].factor);
    this.point = -1;
    this.listen();
  }

  /** Where the map lies in the canvas, CSS pixels. */
  layout() {
    const [left, top, right, bottom] = [66, 10, 104, 46];
    const length = [this.across, 1 - this.across].map((axis) => this.ranges[axis][1] - this.ranges[axis][0]);
    let width = Math.max(60, this.canvas.clientWidth - left - right);
    let height = this.map.is_metric ? (width * length[1]) / length[0] : 0.42 * width;
    const highest = Math.max(260, 0.72 * window.innerHeight);
    if (height > highest) [width, height] = [this.map.is_metric ? (width * highest) / height : width, highest];
    // A strip too narrow to be pointed at is stretched.
    this.box = { left, top, width: Math.max(40, Math.round(width)), height: Math.max(90, Math.round(height)) };
    this.size = [this.canvas.clientWidth, this.box.height + top + bottom];
    this.canvas.style.height = this.size[1] + "px";
  }

  draw() {
    this.layout();
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [this.box.width, this.box.height].map((side) => Math.round(side * ratio));
    const image = new ImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    this.pixels = { at: new Int32Array(width * height).fill(-1), width, height, ratio };
    const colors = this.map.colors.map((text) => {
      const number = parseInt(text.slice(1), 16);
      return 0xff000000 | ((number & 255) << 16) | (number & 0xff00) | (number >> 16);
    });
    const [a, b] = [this.across, 1 - this.across];
    const [scaleA, scaleB] = [width / this.span(a), height / this.span(b)];
    const [halfA, halfB] = [Math.max(0.5, this.half[a] * scaleA), Math.max(0.5, this.half[b] * scaleB)];
    const [low, high] = this.colors;
    const z = this.values[2];
    for (let i = 0; i < z.length; i++) {
      if (!(z[i] === z[i])) continue;
      const u = (this.values[a][i] - this.ranges[a][0]) * scaleA;
      const v = height - (this.values[b][i] - this.ranges[b][0]) * scaleB;
      const level = Math.max(0, Math.min(255, Math.round((255 * (z[i] - low)) / (high - low || 1))));
      const [u0, u1] = [Math.max(0, Math.round(u - halfA)), Math.min(width, Math.round(u + halfA))];
      const [v0, v1] = [Math.max(0, Math.round(v - halfB)), Math.min(height, Math.round(v + halfB))];
      for (let y = v0; y < v1; y++) {
        for (let x = u0; x < u1; x++) {
          pixels[y * width + x] = colors[level];
          this.pixels.at[y * width + x] = i;
        }
      }
    }
    this.image = document.createElement("canvas");
    [this.image.width, this.image.height] = [width, height];
    this.image.getContext("2d").putImageData(image, 0, 0);
    this.paint();
  }

  span(axis) {
    return this.ranges[axis][1] - this.ranges[axis][0];
  }

  /** The drawn map with axes, colour bar and the chosen point. */
  paint() {
    const ratio = window.devicePixelRatio || 1;
    [this.canvas.width, this.canvas.height] = this.size.map((side) => Math.round(side * ratio));
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const { left, top, width, height } = this.box;
    context.fillStyle = ink("missing");
    context.fillRect(left, top, width, height);
    context.imageSmoothingEnabled = false;
    context.drawImage(this.image, left, top, width, height);
    context.font = "13px system-ui, sans-serif";
    this.axes(context);
    this.bar(context);
    this.cross(context);
  }

  axes(context) {
    const { left, top, width, height } = this.box;
    const [a, b] = [this.across, 1 - this.across];
    context.strokeStyle = context.fillStyle = ink("faint");
    context.strokeRect(left - 0.5, top - 0.5, width + 1, height + 1);
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const [value, text] of ticks(this.ranges[a], width / 90)) {
      const x = left + ((value - this.ranges[a][0]) / this.span(a)) * width;
      context.fillRect(x, top + height, 1, 5);
      context.fillText(text, x, top + height + 7);
    }
    context.fillText(titled(this.map.axes[a]), left + width / 2, top + height + 26);
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const [value, text] of ticks(this.ranges[b], height / 50)) {
      const y = top + height - ((value - this.ranges[b][0]) / this.span(b)) * height;
      context.fillRect(left - 5, y, 5, 1);
      context.fillText(text, left - 8, y);
    }
    context.save();
    context.translate(12, top + height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    context.fillText(titled(this.map.axes[b]), 0, 0);
    context.restore();
  }

  bar(context) {
    const { left, top, width, height } = this.box;
    const [x, thick] = [left + width + 16, 14];
    this.map.colors.forEach((color, i) => {
      context.fillStyle = color;
      const y = top + height * (1 - (i + 1) / 256);
      context.fillRect(x, y, thick, height / 256 + 1);
    });
    context.fillStyle = ink("faint");
    context.textAlign = "left";
    context.textBaseline = "middle";
    const [low, high] = this.colors;
    for (const [value, text] of ticks(this.colors, height / 45)) {
      const y = top + height * (1 - (value - low) / (high - low || 1));
      context.fillRect(x + thick, y, 4, 1);
      context.fillText(text, x + thick + 7, y);
    }
    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText(titled(this.map.axes[2]), x - 6, top + height + 26);
  }

  cross(context) {
    if (this.point < 0) return;
    const { left, top, width, height } = this.box;
    const [a, b] = [this.across, 1 - this.across];
    const x = left + ((this.values[a][this.point] - this.ranges[a][0]) / this.span(a)) * width;
    const y = top + height - ((this.values[b][this.point] - this.ranges[b][0]) / this.span(b)) * height;
    for (const [color, thick] of [["rgba(0,0,0,.55)", 3], ["#ffffff", 1]]) {
      context.strokeStyle = color;
      context.lineWidth = thick;
      context.beginPath();
      context.moveTo(left, y);
      context.lineTo(left + width, y);
      context.moveTo(x, top);
      context.lineTo(x, top + height);
      context.stroke();
    }
    context.lineWidth = 1;
  }

  /** The measured point nearest to a place of the canvas; -1 where there is none near. */
  near(x, y) {
    const { at, width, height, ratio } = this.pixels;
    const [u, v] = [Math.floor((x - this.box.left) * ratio), Math.floor((y - this.box.top) * ratio)];
    for (let reach = 0; reach < 24; reach++) {
      for (let dv = -reach; dv <= reach; dv++) {
        const step = Math.abs(dv) === reach ? 1 : 2 * reach;
        for (let du = -reach; du <= reach; du += step) {
          const [p, q] = [u + du, v + dv];
          if (p >= 0 && p < width && q >= 0 && q < height && at[q * width + p] >= 0) return at[q * width + p];
        }
      }
    }
    return -1;
  }

  choose(point) {
    if (point < 0 || point === this.point) return;
    this.point = point;
    this.paint();
    this.select(Math.floor(point / this.columns), point % this.columns);
  }

  listen() {
    this.canvas.addEventListener("pointermove", (event) => this.choose(this.near(event.offsetX, event.offsetY)));
    this.canvas.addEventListener("pointerdown", (event) => this.choose(this.near(event.offsetX, event.offsetY)));
    this.canvas.addEventListener("keydown", (event) => {
      const along = this.across === 1 ? [1, this.columns] : [this.columns, 1];
      const step = { ArrowUp: along[0], ArrowDown: -along[0], ArrowRight: along[1], ArrowLeft: -along[1] }[event.key];
      if (!step) return;
      event.preventDefault();
      let point = this.point < 0 ? this.values[2].length >> 1 : this.point;
      // Over what was not measured, up to the border.
      for (let moved = 0; moved < (event.shiftKey ? 10 : 1); ) {
        const next = point + step;
        const leaves = Math.abs(step) === 1 && Math.floor(next / this.columns) !== Math.floor(point / this.columns);
        if (next < 0 || next >= this.values[2].length || leaves) break;
        point = next;
        if (this.values[2][point] === this.values[2][point]) moved++;
      }
      if (this.values[2][point] === this.values[2][point]) this.choose(point);
    });
  }
}
