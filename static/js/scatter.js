// One corner: where it was seen, and the ellipse that each method claims should hold 95 % of that.

import { KINDS } from "./boxes.js";
import { $, el, remake, setText } from "./dom.js";
import { axesOf, SIGMAS } from "./overlay/ellipses.js";
import { select } from "./actions.js";
import { get } from "./store.js";
import { drawing, roundStep, shape } from "./svg.js";
import { fixed, metres } from "./units.js";

const SIZE = 360;
const CENTRE = SIZE / 2;
const LEFT = 24; // of the scale's figures
const HALF = 154; // px from the centre to the end of the scale
const MOST = 0.98; // of the dots that the scale is made for
const MARGIN = 1.1;
const SAME_M = 0.3; // between a corner of the frame and one of the window
const ALIGNED = 0.94; // cosine of the turn between a wall of the frame and one of the window
const MM = 1e3;

/** An empty drawing for `plotScatter`. */
export const scatterDrawing = () => drawing(SIZE, SIZE, "scatter");

const svg = scatterDrawing();
let picked = null; // in the list; else it is the selected corner, or the first

export const scatterPlot = () => svg;

/** Goes back to the corner that is selected. */
export const followSelection = () => (picked = null);

/** The corners of a summary by their id: {id, mean, methods: {name: what that method says}}. */
export const cornersOf = ({ methods }) => byId(methods, ({ corners }) => corners);

function byId(methods, thingsOf) {
  const found = new Map();
  for (const method of methods) {
    for (const thing of thingsOf(method)) {
      const { id, mean } = thing;
      if (!found.has(id)) found.set(id, { id, mean, methods: {} });
      found.get(id).methods[method.name] = thing;
    }
  }
  return [...found.values()].sort((a, b) => a.id - b.id);
}

/** Which corner to show: the one picked, the one selected, or the first. */
export function cornerToShow(corners) {
  const selected = seenNow().find(({ id }) => id === get("selection")?.corner);
  return corners.find(({ id }) => id === picked) ?? (selected && nearest(corners, selected.xy)) ?? corners[0];
}

/** The list to choose from, named as in the table of corners where they are in sight. */
export function drawList(corners, shown) {
  const seen = seenNow();
  const entries = corners.map(({ id, mean }) => {
    const name = nearest(seen, mean);
    return { id, name: name ? `C${name.id}` : "Not in view", where: mean.map(metres).join(", ") };
  });
  remake($("repeatability-corner"), [entries, shown?.id], () =>
    entries.map(({ id, name, where }) =>
      el("option", { value: String(id), selected: id === shown?.id }, `${name}, at ${where}\u2009m`),
    ),
  );
}

/** Takes what was chosen in the list, and selects it in the scene and the table, too. */
export function pick(id, corners) {
  picked = id;
  const corner = corners.find((one) => one.id === id);
  const now = corner && nearest(seenNow(), corner.mean);
  if (now) select({ corner: now.id });
}

/** The corners of the frame: {id, xy}. */
function seenNow() {
  return (get("frame")?.corners ?? []).map(({ id, by_method }) => {
    const [{ x, y }] = Object.values(by_method);
    return { id, xy: [x, y] };
  });
}

/** The corner of a summary that a corner of the frame at a place is, if it is one. */
export const sightedAt = (found, place) => nearest(cornersOf(found), place);

/** The wall of a summary that a wall of a frame, by its main method, is, if it is one. */
export function sightedWall({ walls }, wall, { covariance: kind, methods: [main] }) {
  const alike = byId(walls.methods, (method) => method.walls)
    .filter(({ methods, mean: [alpha] }) => methods[main] && Math.cos(alpha - wall.alpha) > ALIGNED)
    .map((found) => ({ ...found, xy: surestPlace(found.methods[main].mean, found.methods[main].claims[kind].covariance) }));
  return nearest(alike, surestPlace([wall.alpha, wall.r], wall.covariance));
}

/** Where a line is known best across itself: near the middle of its points, which tells walls of one line apart. */
function surestPlace([alpha, r], [[alphas, mixed]]) {
  const [c, s] = [Math.cos(alpha), Math.sin(alpha)];
  const along = mixed / alphas;
  return [r * c - along * s, r * s + along * c];
}

/** The one of some corners, {xy} or {mean}, that is close to a place, if one is. */
function nearest(corners, [x, y]) {
  const distance = ({ xy, mean }) => Math.hypot((xy ?? mean)[0] - x, (xy ?? mean)[1] - y);
  const [best] = corners.filter((corner) => distance(corner) < SAME_M).sort((a, b) => distance(a) - distance(b));
  return best;
}

/** Draws a corner with the dots of one method, m from their mean. */
export function drawScatter({ methods }, dots, dotted) {
  const beyond = plotScatter(svg, claimsOf(methods), dots);
  svg.setAttribute("aria-label", described(methods, dotted));
  setText(
    $("repeatability-dots"),
    `${dots.length} dots, by ${dotted}${beyond ? `, ${beyond} of them farther out` : ""}. x to the right, y up, mm from the mean.`,
  );
}

/** What each method claims of a corner of a summary, by both kinds of covariance. */
export const claimsOf = (methods) =>
  Object.entries(methods).flatMap(([method, { claims }]) =>
    KINDS.map((kind) => ({ method, kind, covariance: claims[kind].covariance })),
  );

/**
 * Draws the 95 % ellipses of claims {method, kind, covariance, offset [x, y] m} and dots, to one scale that holds most
 * of them, with mm at its lines. Returns how many dots lie beyond.
 */
export function plotScatter(svg, claims, dots) {
  const ellipses = claims.map((claim) => ({ offset: [0, 0], ...claim, ...scaledAxes(claim.covariance) }));
  const ways = dots.map(([x, y]) => Math.hypot(x, y)).sort((a, b) => a - b);
  const reaches = ellipses.map(({ long, offset }) => long + Math.hypot(...offset));
  const reach = MARGIN * Math.max(...reaches, ways[Math.floor(MOST * (ways.length - 1))] ?? 0);
  const scale = HALF / reach; // px/m
  const inside = dots.filter((dot) => Math.max(...dot.map(Math.abs)) <= reach);
  svg.replaceChildren(
    ...grid(reach, scale),
    ...inside.map(([x, y]) => shape("circle", { class: "dot", cx: CENTRE + scale * x, cy: CENTRE - scale * y, r: 2 })),
    ...ellipses.map((ellipse) => outline(ellipse, scale)),
  );
  return dots.length - inside.length;
}

/** Half axes (m) and direction (degrees, clockwise as drawn) of the ellipse that should hold 95 %. */
function scaledAxes(covariance) {
  const { long, short, direction } = axesOf(covariance);
  return { long: SIGMAS * long, short: SIGMAS * short, turn: (-180 / Math.PI) * direction };
}

const outline = ({ method, kind, offset: [x, y], long, short, turn }, scale) =>
  shape("ellipse", {
    method,
    class: `claim ${kind}`,
    "data-method": method,
    rx: scale * long,
    ry: scale * short,
    transform: `translate(${CENTRE + scale * x} ${CENTRE - scale * y}) rotate(${turn})`,
  });

/** Lines at round millimetres. */
function grid(reach, scale) {
  const step = roundStep(MM * reach, 2);
  const nodes = [];
  for (let tick = -Math.floor((MM * reach) / step); tick * step <= MM * reach; tick++) {
    const way = (scale * tick * step) / MM;
    const label = fixed(tick * step, step < 1 ? 1 : 0);
    nodes.push(
      shape("path", { class: "grid", d: `M${CENTRE + way} 0V${SIZE - 16}M${LEFT} ${CENTRE - way}H${SIZE}` }),
      shape("text", { class: "tick", x: CENTRE + way, y: SIZE - 4, "text-anchor": "middle" }, label),
      shape("text", { class: "tick", x: LEFT - 4, y: CENTRE - way + 4, "text-anchor": "end" }, label),
    );
  }
  return nodes;
}

/** What is drawn, in words. */
function described(methods, dotted) {
  const told = Object.entries(methods).map(([name, { claims }]) => {
    const held = KINDS.map((kind) => `${kind} ${fixed(100 * claims[kind].judgement.coverage_95.value, 0)}`);
    return `${name}: ${held.join(", ")}`;
  });
  return `Where ${dotted} saw the corner, and the ellipses that should hold 95 percent. They hold, in percent, ${told.join("; ")}.`;
}
