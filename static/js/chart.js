// One uPlot chart over the last seconds, linear from zero or logarithmic in whole decades.

import { $ } from "./dom.js";
import { fixed } from "./units.js";

const HEIGHT = 180;
const SHORTEST_S = 10;
const LONGEST_S = 60;
const SECONDS = [1, 2, 5, 10, 20];
const COUNTS = [1, 2, 5, 10, 20, 50, 100];

/** A chart in `box`, as wide as the panel; series are {colour, dash}, `text` writes a value. */
export function makeChart({ series, log, text }, data, box, onCursor) {
  const axis = { stroke: token("--muted"), grid: { stroke: token("--line"), width: 1 }, font: "11px Plex" };
  const quiet = { ...axis, ticks: { show: false } };
  const options = {
    ...chartSize(),
    legend: { show: false },
    cursor: { sync: { key: "plots" }, drag: { x: false, y: false }, y: false, points: { show: false } },
    hooks: { setCursor: [onCursor] },
    scales: {
      x: { time: false, range: lastSeconds },
      y: log ? { distr: 3, range: decades } : { range: fromZero },
    },
    axes: [
      { ...quiet, size: 24, incrs: SECONDS, values: (_, ticks) => ticks.map(secondsText) },
      {
        ...quiet,
        size: 52,
        values: (_, ticks) => ticks.map(text),
        ...(log ? { splits: powers, filter: everyTick } : { incrs: COUNTS }),
      },
    ],
    series: [
      {},
      ...series.map(({ colour, dash }) => ({ stroke: colour, dash, width: 1.5, points: { show: false } })),
    ],
  };
  const chart = new uPlot(options, data, box);
  chart.root.setAttribute("aria-hidden", "true"); // the caption's list has the figures
  return chart;
}

export const chartSize = () => ({ width: Math.max(200, $("plots").clientWidth - 32), height: HEIGHT });

/** A colour token of the style sheet as a colour the canvas knows. */
export function token(name) {
  const probe = $("plots");
  probe.style.color = `var(${name})`;
  const { color } = getComputedStyle(probe);
  probe.style.color = "";
  return color;
}

const secondsText = (tick) => (tick ? `${fixed(tick, 0)}\u2009s` : "now");

const lastSeconds = (_, oldest) => [Math.max(-LONGEST_S, Math.min(-SHORTEST_S, oldest ?? 0)), 0];

const fromZero = (_, low, high) => [0, Math.max(4, Math.ceil((high ?? 0) * 1.15))];

/** Whole decades around the data. */
function decades(_, low, high) {
  const exponent = (value, round) => 10 ** round(Math.log10(value));
  return low > 0 ? [exponent(low, Math.floor), exponent(high * 1.001, Math.ceil)] : [1, 10];
}

/** uPlot would label only some powers of ten where they lie close. */
const everyTick = (_, ticks) => ticks;

/** Ticks at the powers of ten only. */
function powers(_, axis, low, high) {
  const first = Math.round(Math.log10(low));
  return Array.from({ length: Math.round(Math.log10(high)) - first + 1 }, (_, step) => 10 ** (first + step));
}
