// One uPlot chart: over the last seconds or all there is, on one of a few kinds of scale.

import { fixed } from "./units.js";

const HEIGHT = 180;
const LEAST_WIDTH = 200;
const SHORTEST_S = 10;
const LONGEST_S = 60;
const SECONDS = [1, 2, 5, 10, 20];
const SMALL = 0.01; // below it, an outlying scale is linear
const COUNTS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

/** From zero, in whole decades, as far above zero as below it, and the same where a few lie far out. */
const SCALES = {
  counts: { scale: { range: fromZero }, axis: { incrs: COUNTS } },
  decades: { scale: { distr: 3, range: decades }, axis: { splits: powers, filter: everyTick } },
  signed: { scale: { range: aroundZero }, axis: {} },
  outlying: {
    scale: { distr: 4, asinh: SMALL, range: aroundZero },
    axis: { splits: signedPowers, filter: everyTick },
  },
};

/**
 * A chart in `box`, as wide as it: series are {colour, dash, dots}, `text` writes a value, `scale` is one of
 * SCALES. A `band` {colour} is filled between the last two columns of the data. `times` may replace the axis of the
 * last seconds by {range, values} of uPlot's.
 */
export function makeChart({ series, band, scale, text, times = lately }, data, box, onCursor) {
  const axis = { stroke: token("--muted"), grid: { stroke: token("--line"), width: 1 }, font: "11px Plex" };
  const quiet = { ...axis, ticks: { show: false } };
  const kind = SCALES[scale];
  const edges = band ? [{}, {}] : [];
  const last = series.length + edges.length;
  const { range, ...ticks } = times;
  const chart = new uPlot(
    {
      ...sizeOf(box),
      legend: { show: false },
      cursor: { sync: { key: "plots" }, drag: { x: false, y: false }, y: false, points: { show: false } },
      hooks: { setCursor: [onCursor] },
      scales: { x: { time: false, range }, y: kind.scale },
      axes: [
        { ...quiet, size: 24, ...ticks },
        { ...quiet, size: 52, values: (_, ticks) => ticks.map(text), ...kind.axis },
      ],
      series: [{}, ...series.map(line), ...edges.map(() => ({ points: { show: false } }))],
      bands: band ? [{ series: [last, last - 1], fill: band.colour }] : [],
    },
    data,
    box,
  );
  chart.root.setAttribute("aria-hidden", "true"); // the caption's list has the figures
  return chart;
}

export const sizeOf = (box) => ({ width: Math.max(LEAST_WIDTH, box.clientWidth - 16), height: HEIGHT });

/** A colour token of the style sheet as a colour the canvas knows. */
export function token(name) {
  const probe = document.body;
  probe.style.color = `var(${name})`;
  const { color } = getComputedStyle(probe);
  probe.style.color = "";
  return color;
}

function line({ colour, dash, dots }) {
  if (!dots) return { stroke: colour, dash, width: 1.5, points: { show: false } };
  return {
    paths: () => null,
    points: { show: true, size: 3, space: 0, width: 0, fill: colour, stroke: colour },
  };
}

const lately = {
  range: (_, oldest) => [Math.max(-LONGEST_S, Math.min(-SHORTEST_S, oldest ?? 0)), 0],
  incrs: SECONDS,
  values: (_, ticks) => ticks.map((tick) => (tick ? `${fixed(tick, 0)}\u2009s` : "now")),
};

function fromZero(_, low, high) {
  return [0, Math.max(4, Math.ceil((high ?? 0) * 1.15))];
}

function aroundZero(_, low, high) {
  const most = 1.1 * Math.max(Math.abs(low ?? 0), Math.abs(high ?? 0), 1e-3);
  return [-most, most];
}

/** Whole decades around the data. */
function decades(_, low, high) {
  const exponent = (value, round) => 10 ** round(Math.log10(value));
  return low > 0 ? [exponent(low, Math.floor), exponent(high * 1.001, Math.ceil)] : [1, 10];
}

/** uPlot would label only some powers of ten where they lie close. */
function everyTick(_, ticks) {
  return ticks;
}

/** Ticks at the powers of ten only. */
function powers(_, axis, low, high) {
  const first = Math.round(Math.log10(low));
  return Array.from({ length: Math.round(Math.log10(high)) - first + 1 }, (_, step) => 10 ** (first + step));
}

/** Zero, and the powers of ten from SMALL on to either side of it. */
function signedPowers(_, axis, low, high) {
  const ticks = [];
  for (let tick = SMALL; tick <= high; tick *= 10) ticks.push(tick);
  return [...ticks.map((tick) => -tick).reverse(), 0, ...ticks];
}
