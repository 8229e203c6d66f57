// A chart with its caption: what each line is, and its value under the cursor or else the newest.

import { makeChart, sizeOf, token } from "./chart.js";
import { el, setText } from "./dom.js";
import { UNKNOWN } from "./units.js";

/**
 * A figure of series {label, mark, colour, dash, dots}, a band {label, mark, colour}, title, scale, text and times
 * (see makeChart); the last series is drawn on top and named first. `columns()` gives the data: times, a column for each series, and two for the band.
 * Returns {node, redraw(), remove()}.
 */
export function makeFigure({ title, series, band, text, columns, ...kind }) {
  const values = series.map(() => el("output", {}, UNKNOWN));
  const entries = series.map(({ label, mark }, at) => el("li", {}, mark, label, values[at]));
  if (band) entries.unshift(el("li", {}, band.mark, band.label));
  const box = el("div", { class: "chart" });
  const caption = el("figcaption", {}, el("h2", {}, title), el("ul", {}, ...entries.reverse()));
  const chart = makeChart({ series, band, text, ...kind }, columns(), box, showValues);
  const watch = new ResizeObserver(() => box.clientWidth && chart.setSize(sizeOf(box)));
  watch.observe(box);

  function showValues({ cursor, data }) {
    const at = cursor.idx ?? data[0].length - 1;
    values.forEach((output, index) => setText(output, text(data[index + 1][at] ?? NaN)));
  }

  function redraw() {
    chart.setData(columns());
    showValues(chart);
  }

  function remove() {
    watch.disconnect();
    chart.destroy();
  }

  showValues(chart);
  return { node: el("figure", {}, caption, box), redraw, remove };
}

/** The sign of a line in the caption: how it is drawn, by class. */
export const stroke = (kind) => el("span", { class: `swatch stage ${kind}`, "aria-hidden": "true" });

/** A line of a figure in the colour of a token of the style sheet, its sign in the caption of the same. */
export const line = ({ key, tone, ...rest }) => ({ ...rest, colour: token(tone), mark: stroke(key) });
