// Plots over time: stage times, corners and median ellipse area per method.

import { chartSize, makeChart, token } from "./chart.js";
import { methodColour } from "./colours.js";
import { $, el, setText, swatch } from "./dom.js";
import { columns } from "./history.js";
import { on } from "./store.js";
import { fixed, microseconds, squareMillimetres } from "./units.js";

const REDRAW_MS = 400;

const STAGES = [
  { key: "extract", label: "Extraction", dash: [], tone: "--text" },
  { key: "draw", label: "Drawing", dash: [], tone: "--edge" },
  { key: "age", label: "Scan to page", dash: [4, 3], tone: "--muted" },
];

const PLOTS = [
  { title: "Time per scan", series: stages, log: true, text: microseconds },
  { title: "Corners", series: perMethod("corners"), log: false, text: (value) => fixed(value, 0) },
  { title: "Median ellipse area, mm²", series: perMethod("median_area"), log: true, text: squareMillimetres },
];

let plots = [];
let drawn = 0;
let made = "";

export function mountPlots() {
  on(["frame", "panel", "settings", "methods"], redraw);
  new ResizeObserver(() => plots.forEach(({ chart }) => chart.setSize(chartSize()))).observe($("plots"));
}

function stages() {
  const mark = (key) => el("span", { class: `swatch stage ${key}`, "aria-hidden": "true" });
  return STAGES.map(({ key, label, dash, tone }) => {
    return { label, dash, colour: token(tone), mark: mark(key), read: (sample) => sample[key] || null };
  });
}

function perMethod(figure) {
  return (methods) =>
    methods.map((name) => {
      const read = ({ summary }) => summary[name]?.[figure];
      return { label: name, colour: methodColour(name), mark: swatch(name), read };
    });
}

function redraw(frame, panel) {
  if (panel !== "plots") return;
  const wanted = `${frame.methods.join()} ${document.documentElement.dataset.theme}`;
  if (wanted === made && performance.now() - drawn < REDRAW_MS) return;
  if (wanted !== made) make(frame.methods);
  made = wanted;
  drawn = performance.now();
  for (const plot of plots) {
    plot.chart.setData(dataOf(plot));
    showValues(plot);
  }
}

function make(methods) {
  plots.forEach(({ chart }) => chart.destroy());
  // The main method comes last: it is drawn on top of the others.
  plots = PLOTS.map((kind) => ({ ...kind, series: kind.series(methods).reverse() }));
  $("plots").replaceChildren(...plots.map(figure));
}

const dataOf = ({ series }) => columns(series.map(({ read }) => read));

function figure(plot) {
  plot.values = plot.series.map(() => el("output", {}, "\u2013"));
  const entries = plot.series.map(({ label, mark }, at) => el("li", {}, mark, label, plot.values[at]));
  const box = el("div", { class: "chart" });
  plot.chart = makeChart(plot, dataOf(plot), box, (chart) => showValues({ ...plot, chart }));
  return el(
    "figure",
    {},
    el("figcaption", {}, el("h2", {}, plot.title), el("ul", {}, ...entries.reverse())),
    box,
  );
}

/** The captions tell the values under the cursor, or else the newest. */
function showValues({ chart, values, text }) {
  const at = chart.cursor.idx ?? chart.data[0].length - 1;
  values.forEach((output, index) => setText(output, text(chart.data[index + 1][at] ?? NaN)));
}
