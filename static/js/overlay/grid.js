// The grid on the floor: lines at round metres, as far apart as the eye likes at every zoom, named at the edge of the view.

import { roundStep } from "../svg.js";
import { fixed } from "../units.js";

const APART_PX = 70; // between lines, at least
const MOST = 60; // lines each way: seen at a slant, the floor goes on and on
const INSET = 6; // px, of the numbers from the lower edge
const LEFT = 14; // px, from the left one
const HIGH = 14; // px, of a number, as wide as half of that for each of its characters
const BAR_PX = 120; // of the scale bar, at most

/** The smallest of 1, 2, 5 times a power of ten, m, by which lines are far enough apart. */
function stepOf(look) {
  const least = APART_PX / look.scale;
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= least);
}

const digitsOf = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));

/**
 * Draws the lines, and the metres of each at the edge of the view, but for numbers of which part would lie under what covers
 * the lower left corner: {right, top, bottom}, px.
 */
export function drawGrid(pen, look, { line, axis, text, halo }, covered = null) {
  const step = stepOf(look);
  const bounds = boundsOf(look);
  if (!bounds || !Number.isFinite(step)) return;
  for (const along of [0, 1]) {
    const [low, high] = bounds[along].map((end) => end / step);
    if (high - low > MOST) continue;
    for (let at = Math.ceil(low); at <= high; at++) {
      const ends = bounds[1 - along].map((end) => look.toScreen(along ? [end, at * step] : [at * step, end]));
      if (!ends.every(Boolean)) continue;
      pen.path(ends.map(crisp), { stroke: at === 0 ? axis : line, width: 1 });
      name(pen, look, covered, ends, `${fixed(at * step, digitsOf(step))}${at === 0 ? "" : "\u2009m"}`, { fill: text, halo });
    }
  }
}

/** From and to along x and along y of the floor that is seen, m; null at a slant so flat that it has no end. */
function boundsOf(look) {
  const { width, height } = look;
  const corners = [[0, 0], [width, 0], [0, height], [width, height]].map((pixel) => look.toFloor(pixel));
  if (!corners.every(Boolean)) return null;
  return [0, 1].map((axis) => {
    const values = corners.map((corner) => corner[axis]);
    return [Math.min(...values), Math.max(...values)];
  });
}

/** Between pixels, a line of one pixel would be two that are half as bright. */
const crisp = ([x, y]) => [Math.round(x) + 0.5, Math.round(y) + 0.5];

/** A number where an upright line leaves the view below, or a level one at the left. */
function name(pen, { width, height }, covered, [[x0, y0], [x1, y1]], words, style) {
  const wide = (HIGH / 2) * words.length;
  const isFree = (left, base) => !covered || left > covered.right || base < covered.top || base - HIGH > covered.bottom;
  const isUpright = Math.abs(y1 - y0) > Math.abs(x1 - x0);
  if (isUpright) {
    const x = x0 + ((height - y0) / (y1 - y0)) * (x1 - x0);
    if (x > 30 && x < width - 30 && isFree(x - wide / 2, height - INSET)) pen.text([x, height - INSET], words, { ...style, anchor: "middle" });
  } else {
    const y = y0 + ((0 - x0) / (x1 - x0)) * (y1 - y0);
    if (y > 20 && y < height - 24 && isFree(LEFT, y - 4)) pen.text([LEFT, y - 4], words, style);
  }
}

/** A length that is round and fits in the view: {length m, pixels}. */
export function scaleBar(look) {
  const length = roundStep(BAR_PX / look.scale, 1);
  return { length, pixels: length * look.scale };
}
