// Repeatability: while the sensor stands still, do the corners scatter as each method claims?

import { request } from "./api.js";
import { switchRow } from "./bindings.js";
import { boxPlot, drawBoxes } from "./boxes.js";
import { calibrateHint, claimTable, drawClaims, drawTable } from "./claims.js";
import { $, el, setText, swatch } from "./dom.js";
import { throttled } from "./throttle.js";
import { parameterRow } from "./parameters.js";
import { cornersOf, cornerToShow, drawList, drawScatter, followSelection, pick, scatterPlot, sightedWall } from "./scatter.js";
import { selectedWall } from "./selected-wall.js";
import { attempt } from "./actions.js";
import { get, on, set } from "./store.js";

const REFRESH_MS = 1000;

const ABOUT =
  "Keep the sensor still. Each corner and wall is then found at a slightly different place in every scan, and its ellipse should be as large as this scatter. Here the scatter is compared with what each method claims.";

let before = ""; // what the page last asked for, besides new scans
let followed = null; // the corner selected last

export function mountRepeatability() {
  on(["fields"], make);
  const refresh = throttled(REFRESH_MS, ask);
  on(["frame", "panel", "settings", "fields", "selection", "wall"], (frame, panel, { repeatability, view }, _, { corner }, wall) => {
    const now = JSON.stringify([panel, repeatability, view.compare, corner, Boolean(wall)]);
    const isShown = panel === "repeatability" || view.compare || corner !== null || wall;
    if (isShown && (repeatability.running || now !== before)) refresh();
    before = now;
  });
  on(["selection", "panel"], ({ corner }, panel) => {
    if (corner === followed) return; // the server tells of it again and again
    followed = corner;
    followSelection();
    if (panel === "repeatability" || corner !== null) showCorner();
  });
  on(["methods", "fields"], (methods) =>
    $("repeatability-methods").replaceChildren(...methods.map(({ name }) => el("li", {}, swatch(name), name))),
  );
  on(["repeatability", "settings", "methods"], draw);
  on(["deviations", "settings"], drawDots);
}

function make(fields) {
  const window = fields.find(({ path }) => path === "repeatability.window");
  const title = (id, text) => el("h2", { id }, text);
  $("repeatability").replaceChildren(
    el(
      "section",
      { "aria-labelledby": "repeatability-title" },
      title("repeatability-title", "Repeatability"),
      el("p", { class: "muted about" }, ABOUT),
      switchRow("Compare with the scatter", "repeatability.running"),
      parameterRow({ ...window, unit: "scans" }),
      progress(),
      el("p", { id: "repeatability-message", class: "notice", hidden: true }),
      calibrateHint(),
      el("p", { id: "repeatability-verdict" }),
      el("div", { class: "buttons" }, startOver(), download()),
    ),
    el(
      "section",
      { id: "repeatability-areas", "aria-labelledby": "areas-title", hidden: true },
      title("areas-title", "Claimed ellipse areas, mm²"),
      legend({ box: true, last: sign("actual", "area of the scatter") }),
      boxPlot(),
      el("p", { class: "muted" }, "1σ; each scan's median over its corners. A box to the left of the line claims too small an area (overconfident), one to its right too large an area (cautious). Where a few corners are disturbed, the table decides: line and boxes are medians of different things."),
    ),
    el(
      "section",
      { id: "repeatability-claims", "aria-labelledby": "claims-title", hidden: true },
      title("claims-title", "Corners: claim and scatter"),
      el("div", { class: "table-scroll", tabIndex: -1 }, claimTable()),
      el("p", { class: "muted" }, "First the sum of the areas, where large ellipses of far corners weigh most; then how much of the scatter, in %, the ellipses of 50, 95 and 99 % hold. Below each its 95 % confidence interval."),
    ),
    el(
      "section",
      { id: "repeatability-walls", "aria-labelledby": "walls-title", hidden: true },
      title("walls-title", "Walls: claim and scatter"),
      el("p", { id: "repeatability-walls-verdict" }),
      el("div", { class: "table-scroll", tabIndex: -1 }, claimTable("repeatability-walls-table")),
      el("p", { class: "muted" }, "The same for the direction and distance of walls. Many rooms show no corner, but all show walls; where a wall ends changes from scan to scan, and that is part of its scatter."),
    ),
    el(
      "section",
      { id: "repeatability-scatter", "aria-labelledby": "scatter-title", hidden: true },
      title("scatter-title", "One corner"),
      cornerRow(),
      legend({ last: sign("dot", "seen there") }),
      el("ul", { class: "signs", id: "repeatability-methods" }),
      scatterPlot(),
      el("p", { id: "repeatability-dots", class: "muted" }),
    ),
  );
}

function progress() {
  return el(
    "div",
    { id: "repeatability-progress" },
    el("progress", { max: 1, value: 0, "aria-label": "Scans in the window" }),
    el("output", {}),
  );
}

function startOver() {
  const clear = async () => {
    await request("DELETE", "repeatability");
    await ask();
  };
  const onclick = () => attempt(clear, "The window could not be cleared");
  return el("button", { type: "button", id: "start-over", title: "Forget the scans of the window", onclick }, "Start over");
}

const download = () =>
  el("a", { class: "button quiet", href: "api/v1/repeatability?format=csv", download: "repeatability.csv", "aria-label": "CSV of the repeatability" }, "CSV");

function cornerRow() {
  const list = el("select", { id: "repeatability-corner" });
  list.addEventListener("change", () => {
    pick(Number(list.value), cornersOf(get("repeatability")));
    showCorner();
  });
  return el("div", { class: "row" }, el("label", { for: list.id }, "Corner"), list);
}

/** The signs of both kinds of covariance, as boxes or as lines, and of what they are held against. */
function legend({ box = false, last }) {
  const kinds = ["consistent", "published"].map((kind) => sign(box ? `box ${kind}` : kind, kind));
  return el("ul", { class: "signs" }, ...kinds, last);
}

const sign = (name, text) => el("li", {}, el("span", { class: `sign ${name}`, "aria-hidden": "true" }), text);

/** Asks for the window as it is now, and for the dots of the corner shown. What does not answer is asked again. */
async function ask() {
  const found = await request("GET", "repeatability").catch(() => null);
  if (!found) return;
  set("repeatability", found);
  await Promise.all([showCorner(found), showWall(found)]);
}

async function showWall(found) {
  const wall = selectedWall(get("frame"));
  const sighted = wall && sightedWall(found, wall, get("frame"));
  if (sighted) await showDots("wallDeviations", `walls/${sighted.id}`);
}

async function showCorner(found = get("repeatability")) {
  const corner = found && cornerToShow(cornersOf(found));
  if (corner) await showDots("deviations", `corners/${corner.id}`);
}

async function showDots(key, path) {
  const dots = await request("GET", `repeatability/${path}`).catch(() => null); // it may be gone by now
  if (dots) set(key, dots);
}

function draw(found, { extraction, repeatability }) {
  const { scans, window, message, methods, walls } = found;
  const corners = cornersOf(found);
  const [bar, text] = $("repeatability-progress").children;
  bar.value = scans / window;
  setText(text, `${scans} of ${window} scans`);
  $("repeatability-progress").hidden = !scans && !repeatability.running;
  setText($("repeatability-message"), message ?? "");
  $("repeatability-message").hidden = !message || !(scans || repeatability.running);
  $("start-over").disabled = !scans;
  drawBoxes(methods);
  $("repeatability-claims").hidden = $("repeatability-scatter").hidden = !corners.length;
  drawClaims(methods, extraction);
  $("repeatability-walls").hidden = !walls.methods.some((method) => method.walls.length);
  drawTable(walls.methods, extraction, "repeatability-walls-table", "repeatability-walls-verdict");
}

/** The dots are those of the method in use. */
function drawDots({ id, deviations }, { extraction: { fitter } }) {
  const corners = cornersOf(get("repeatability"));
  const corner = corners.find((one) => one.id === id);
  if (!corner) return;
  drawList(corners, corner);
  drawScatter(corner, deviations[fitter] ?? [], fitter);
}
