"use strict";

const CHART_HEIGHT = 230;

/** An axis of a chart in the colours of the page. */
function axis(label) {
  return {
    label,
    stroke: () => ink("faint"),
    grid: { stroke: () => ink("line"), width: 1 },
    ticks: { stroke: () => ink("line"), width: 1 },
    font: "12px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    labelSize: 22,
    size: 52,
  };
}

function curve(name, at, digits, unit) {
  return {
    label: name,
    stroke: () => ink("curve-" + (at % 6)),
    width: 1.4,
    points: { show: false },
    value: (_, value) => (value == null ? "–" : value.toFixed(digits) + unit),
  };
}

/** A chart as wide as its place. */
function chart(place, options, data) {
  const width = () => Math.max(200, place.clientWidth);
  const plot = new uPlot({ width: width(), height: CHART_HEIGHT, ...options }, data, place);
  new ResizeObserver(() => {
    if (plot.width !== width()) plot.setSize({ width: width(), height: CHART_HEIGHT });
  }).observe(place);
  return plot;
}

/** Curves over the recording. */
function seriesChart(series) {
  const place = document.getElementById("chart-" + series.id);
  const [, unit] = /\[(.*)\]/.exec(series.y_label) || [0, ""];
  // A single value is a point, not a line.
  const single = series.x.length === 1;
  return chart(
    place,
    {
      scales: { x: { time: false } },
      axes: [{ ...axis(series.x_label), size: 40 }, axis(series.y_label)],
      series: [
        { label: series.x_label },
        ...series.curves.map(({ name }, at) => ({ ...curve(name, at, 3, " " + unit), points: { show: single } })),
      ],
      cursor: { sync: { key: series.x_label }, drag: { x: true, y: false } },
    },
    [series.x, ...series.curves.map(({ values }) => values)],
  );
}

/** A section through the map; `mark` is where the pointer is in it. */
class Section {
  constructor(place, map, colors) {
    this.mark = null;
    const z = map.axes[2];
    this.plot = chart(
      place,
      {
        scales: {
          x: { time: false },
          // The scale of colours at least, so that sections can be compared while the pointer moves; just that when it was chosen.
          y: { range: (_, low, high) => this.range(low, high) },
        },
        axes: [{ ...axis(""), size: 40 }, axis(titled(z))],
        series: [{ label: "at" }, curve(z.label, 0, z.digits, " " + z.unit)],
        legend: { live: true },
        hooks: { draw: [(plot) => this.drawMark(plot)] },
      },
      [[0], [null]],
    );
    this.colors = colors;
  }

  range(low, high) {
    const [least, most] = this.colors || [0, 1];
    const ends = this.isFixed ? [least, most] : [Math.min(low ?? least, least), Math.max(high ?? most, most)];
    const margin = 0.06 * (ends[1] - ends[0]) || 0.5;
    return [ends[0] - margin, ends[1] + margin];
  }

  drawMark(plot) {
    if (this.mark == null) return;
    const x = plot.valToPos(this.mark, "x", true);
    plot.ctx.save();
    plot.ctx.strokeStyle = ink("accent");
    plot.ctx.beginPath();
    plot.ctx.moveTo(x, plot.bbox.top);
    plot.ctx.lineTo(x, plot.bbox.top + plot.bbox.height);
    plot.ctx.stroke();
    plot.ctx.restore();
  }

  show({ at, z, mark, label }) {
    this.mark = mark;
    this.plot.axes[0].label = label;
    this.plot.series[0].label = label;
    this.plot.setData([at, z]);
  }
}
