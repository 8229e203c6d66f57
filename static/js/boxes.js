// Box plots of the ellipse areas that each method claims, on a logarithmic axis, beside the area of the scatter itself.

import { $ } from "./dom.js";
import { drawing, logTicks, shape } from "./svg.js";

export const KINDS = ["consistent", "published"];

const WIDTH = 360;
const LEFT = 88;
const RIGHT = 352;
const ROW = 36;
const BAR = 10; // height of a box
const TOPS = { consistent: 6, published: 20 }; // of the boxes in a row
const MARGIN = 1.2; // times the largest area, to the end of the axis
const MM2 = 1e6;

const svg = drawing(WIDTH, 0, "boxes");

export const boxPlot = () => svg;

/** Draws the boxes of a summary's methods. */
export function drawBoxes(methods) {
  const areas = methods.flatMap(({ actual_area: actual, claims }) => [
    actual,
    ...Object.values(claims).flatMap(({ areas: box }) => (box ? [box.low, box.high, ...box.outliers] : [])),
  ]);
  const shown = areas.filter((area) => area > 0);
  $("repeatability-areas").hidden = !shown.length;
  if (!shown.length) return;
  const low = Math.min(...shown) / MARGIN;
  const high = Math.max(...shown) * MARGIN;
  const span = Math.log(high / low);
  const x = (area) => LEFT + ((RIGHT - LEFT) * Math.log(Math.max(area, low) / low)) / span;
  const bottom = ROW * methods.length;
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${bottom + 20}`);
  svg.setAttribute("aria-label", described(methods));
  svg.replaceChildren(
    ...logTicks(low * MM2, high * MM2).flatMap((tick) => axis(tick, x(tick / MM2), bottom)),
    ...methods.flatMap((method, row) => rowOf(method, row * ROW, x)),
  );
}

function axis(tick, at, bottom) {
  return [
    shape("path", { class: "grid", d: `M${at} 0V${bottom}` }),
    shape("text", { class: "tick", x: at, y: bottom + 14, "text-anchor": "middle" }, String(tick)),
  ];
}

function rowOf({ name, actual_area: actual, claims }, top, x) {
  return [
    shape("path", { class: "grid", d: `M0 ${top + ROW}H${WIDTH}` }),
    shape("text", { x: 0, y: top + ROW / 2 + 4 }, name),
    ...KINDS.flatMap((kind) => boxOf(claims[kind].areas, x, top + TOPS[kind], { method: name, kind })),
    ...(actual ? [shape("path", { class: "actual", d: `M${x(actual)} ${top + 2}v${ROW - 4}` })] : []),
  ];
}

function boxOf(box, x, top, { method, kind }) {
  if (!box) return [];
  const middle = top + BAR / 2;
  const [first, third, median] = [box.first_quartile, box.third_quartile, box.median].map(x);
  return [
    shape("path", {
      method,
      class: "whisker",
      d: `M${x(box.low)} ${middle}H${first}M${third} ${middle}H${x(box.high)}`,
    }),
    shape("rect", {
      method,
      class: `box ${kind}`,
      x: first,
      y: top,
      width: Math.max(third - first, 1),
      height: BAR,
    }),
    shape("path", { method, class: `median ${kind}`, d: `M${median} ${top}v${BAR}` }),
    ...box.outliers.map((area) => shape("circle", { method, class: "outlier", cx: x(area), cy: middle, r: 1.5 })),
  ];
}

/** What the boxes show, in words. */
function described(methods) {
  const told = methods.map(({ name, actual_area: actual, claims }) => {
    const medians = KINDS.map((kind) => `${kind} ${text(claims[kind].areas?.median)}`);
    return `${name}: ${medians.join(", ")}, scatter ${text(actual)}`;
  });
  return `Median claimed ellipse area and area of the scatter, mm². ${told.join("; ")}.`;
}

const text = (area) => (area ? Number((area * MM2).toPrecision(2)) : "unknown");
