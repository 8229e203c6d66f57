// What a thing of the map was, from second to second, relative to what it is: a figure.

import { token } from "./chart.js";
import { line, stroke } from "./figure.js";
import { fixed, millimetres } from "./units.js";

/**
 * The figure of states, the oldest first, that have last_seen (s). `lines` {label, key, tone, of(state) m} are drawn in
 * the band of the standard deviation that each state had, `sigma(state)` m; `scale` as `makeFigure` knows them.
 */
export function earlierFigure({ title, states, lines, sigma, scale = "signed" }) {
  const newest = states.at(-1)?.last_seen ?? 0;
  const sigmas = states.map(sigma);
  const data = [
    states.map(({ last_seen }) => last_seen - newest),
    ...lines.map(({ of }) => states.map(of)),
    sigmas.map((value) => -value),
    sigmas,
  ];
  return {
    title,
    series: lines.map(({ label, key, tone }) => line({ label, key, tone, dots: states.length < 3 })),
    band: { label: "±1σ", mark: stroke("band"), colour: token("--band") },
    scale,
    text: millimetres,
    times: {
      range: (_, low, high) => [Math.min(low ?? 0, high - 1), high],
      values: (_, ticks) => ticks.map(before),
    },
    columns: () => data,
  };
}

const before = (tick) => (tick === 0 ? "last" : `${fixed(tick, 0)}\u2009s`);
