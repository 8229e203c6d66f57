// A card over the view: the selected corner or wall, what each method claims of it, and how often that was so; of a wall
// of the map, what it was before.

import { changeSetting, select } from "./actions.js";
import { $, el, iconButton, remake, setText, swatch } from "./dom.js";
import { makeFigure } from "./figure.js";
import { fillHeld, heldTable } from "./held.js";
import { inspectedCorner } from "./inspected-corner.js";
import { inspectedMapped, mountInspectedMapped } from "./inspected-mapped.js";
import { inspectedWall, mountInspectedWall } from "./inspected-wall.js";
import { lookNow } from "./scene.js";
import { claimsOf, plotScatter, scatterDrawing } from "./scatter.js";
import { get, on } from "./store.js";
import { wide } from "./tabs.js";

const SHOWN = ["frame", "selection", "wall", "mapped", "mappedWall", "wallHistory", "length", "repeatability", "deviations", "wallDeviations", "settings"];

let shown; // what the card is about

const drawing = scatterDrawing();
const title = el("span");
const facts = el("dl", { class: "facts" });
const rows = el("table", { class: "listing" });
const ways = el("p", { class: "ways" });
const caption = el("p", { class: "muted" });
const counts = heldTable();
const history = el("div");
const start = el("button", { type: "button", title: "Keep the sensor still meanwhile" }, "Compare with the next scans");
const sightings = el("div", {}, drawing, caption, counts, start);

const fold = iconButton("fold", "Fold the inspector", () => setFolded(!$("inspector").classList.contains("folded")));
fold.id = "fold";

function setFolded(isFolded) {
  $("inspector").classList.toggle("folded", isFolded);
  fold.setAttribute("aria-expanded", String(!isFolded));
}

/** The card is made once: what a finger presses is still there when it is lifted. */
export function mountInspector() {
  mountInspectedWall();
  mountInspectedMapped();
  start.addEventListener("click", () => changeSetting("repeatability.running", true));
  const close = iconButton("close", "Close the inspector", () => select({ corner: null }));
  $("inspector").append(el("h2", {}, title, fold, close), facts, rows, ways, sightings, history);
  setFolded(false);
  new ResizeObserver(foldLegend).observe($("inspector"));
  $("legend").addEventListener("toggle", () => $("legend").open && isOnLegend() && setFolded(true));
  for (const key of SHOWN) on([key], refresh);
  on(["panel"], () => wide.matches || setFolded(true)); // on a narrow page it lies over the panels
}

function refresh() {
  const frame = get("frame");
  const thing = frame && (inspectedMapped(frame) ?? inspectedWall(frame) ?? inspectedCorner(frame));
  $("inspector").hidden = !thing;
  if (thing?.key !== shown) {
    standAside(thing);
    if (!wide.matches) setFolded(false);
  }
  if (thing) draw(thing);
}

/** The card stands where the thing is not. */
function standAside(thing) {
  shown = thing?.key;
  if (!thing) return;
  const at = lookNow().toScreen(thing.at);
  $("inspector").classList.toggle("left", Boolean(at) && at[0] > $("stage").clientWidth / 2);
  foldLegend();
}

let isLegendFolded = false; // by the card

/** What was opened last has the place: the card folds the legend until it closes, and the legend folds the card. */
function foldLegend() {
  const isGone = $("inspector").hidden;
  if (isGone ? !isLegendFolded : !$("legend").open || !isOnLegend()) return;
  isLegendFolded = !isGone;
  $("legend").open = isGone;
}

function isOnLegend() {
  const [card, legend] = ["inspector", "legend"].map((id) => $(id).getBoundingClientRect());
  return card.left < legend.right && legend.left < card.right && card.top < legend.bottom && legend.top < card.bottom;
}

function draw(thing) {
  setText(title, thing.name);
  facts.classList.toggle("long", Boolean(thing.history));
  showFacts(thing.facts);
  showRows(thing.rows);
  showWays(thing.ways);
  sightings.hidden = Boolean(thing.history);
  showHistory(thing);
  if (!thing.history) drawSightings(thing);
}

/** `sighted` is what the last scans say of the thing, if they are compared; `claims` what this scan says. */
function drawSightings({ name, methods, sighted, deviations, claims, axes }) {
  const dots = (sighted && deviations?.id === sighted.id && deviations.deviations[methods[0]]) || [];
  fillHeld(counts, sighted?.methods ?? {}, methods);
  setText(caption, sighted ? `95\u2009% ellipses and the last ${dots.length} sightings by ${methods[0]}, from their mean: ${axes}` : `95\u2009% ellipses of this scan: ${axes}`);
  start.hidden = get("settings").repeatability.running;
  plotScatter(drawing, sighted ? claimsOf(chosen(sighted.methods, methods)) : claims, dots);
  drawing.setAttribute("aria-label", `${name}: ellipses of ${methods.join(", ")}, and where it was seen`);
}

function showFacts(pairs) {
  remake(facts, pairs, () => pairs.map(([name, text]) => el("div", {}, el("dt", {}, name), el("dd", {}, text))));
}

/** What each method says, in a row each. */
function showRows(wanted) {
  const rowOf = ([method, texts]) =>
    el("tr", {}, el("th", { scope: "row", class: "name" }, swatch(method), method), ...texts.map((text) => el("td", {}, text)));
  const heads = ["Method", "α, °", "σ, °", "r, m", "σ, mm"].map((text, at) => el("th", { scope: "col", class: at ? "" : "name" }, text));
  rows.hidden = !wanted.length;
  remake(rows, wanted, () => [el("thead", {}, el("tr", {}, ...heads)), el("tbody", {}, ...wanted.map(rowOf))]);
}

/** Buttons to what the thing is made of, or part of: [text, run]. They stay, so that none is gone while it is pressed. */
function showWays(wanted) {
  while (ways.children.length < wanted.length) ways.append(el("button", { type: "button" }));
  [...ways.children].forEach((button, at) => {
    const [text, run] = wanted[at] ?? ["", null];
    button.hidden = !run;
    button.onclick = run;
    setText(button, text);
  });
}

let chart = null;

/** What a thing of the map was, if it has a `history` that is not empty; `figure()` makes of it what is drawn. */
function showHistory({ key, history: states, figure }) {
  remake(history, [states?.length && key, states?.at(-1), document.documentElement.dataset.theme], () => {
    chart?.remove();
    chart = states?.length ? makeFigure(figure()) : null;
    return chart ? [chart.node] : [];
  });
}

const chosen = (all, names) => Object.fromEntries(names.filter((name) => all[name]).map((name) => [name, all[name]]));
