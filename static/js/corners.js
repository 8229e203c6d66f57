// The table of corners: one row each, for every method its position, deviations and ellipse area.
// Rows are kept by corner id and only texts that differ are written: at 10 Hz most of it stands still.

import { $, el, setText, swatch } from "./dom.js";
import { select } from "./session.js";
import { get, on } from "./store.js";
import { degrees, metres, microseconds, millimetres, squareMillimetres } from "./units.js";

const QUANTITIES = [
  { key: "x", label: "x", unit: "m", text: metres },
  { key: "y", label: "y", unit: "m", text: metres },
  { key: "sigma_x", label: "σx", unit: "mm", text: millimetres },
  { key: "sigma_y", label: "σy", unit: "mm", text: millimetres },
  { key: "area", label: "area", unit: "mm²", text: squareMillimetres },
  { key: "angle", label: "angle", unit: "°", text: degrees, alone: true },
];

/** The columns of each method; what hardly differs between methods is left out of a comparison. */
const quantitiesFor = (methods) => QUANTITIES.filter(({ alone }) => !alone || methods.length === 1);

const rows = new Map(); // corner id -> row
let columns = ""; // the methods the header is made for

export function mountCorners() {
  const body = $("corner-table").tBodies[0];
  body.addEventListener("click", ({ target }) => choose(target.closest("tr")));
  body.addEventListener("keydown", walk);
  on(["frame", "methods"], draw);
  on(["selection"], markSelected);
}

/** Selects the corner `by` rows further; the first or last one if none is selected. */
export function selectNeighbour(by) {
  const ids = [...rows.keys()];
  const at = ids.indexOf(get("selection")?.corner);
  const next = at < 0 ? (by > 0 ? 0 : ids.length - 1) : Math.min(ids.length - 1, Math.max(0, at + by));
  if (ids.length) select(ids[next]);
}

function draw({ methods, corners, timings }, known) {
  if (methods.join() !== columns) makeHead(methods, known);
  for (const cost of $("corner-table").tHead.querySelectorAll(".cost")) {
    setText(cost, microseconds(timings.per_method[cost.dataset.method]));
  }
  const sorted = [...corners].sort((a, b) => a.id - b.id);
  keepOnly(new Set(sorted.map(({ id }) => id)));
  const body = $("corner-table").tBodies[0];
  sorted.forEach((corner, position) => {
    const row = rows.get(corner.id) ?? makeRow(corner.id, methods);
    if (body.rows[position] !== row) body.insertBefore(row, body.rows[position] ?? null);
    fillRow(row, corner, methods);
  });
  rows.clear();
  for (const row of body.rows) rows.set(row.corner, row);
  setText($("corner-count"), corners.length);
  $("corner-none").hidden = corners.length > 0;
  markSelected(get("selection"));
}

function keepOnly(ids) {
  for (const [id, row] of rows) {
    if (!ids.has(id)) {
      row.remove();
      rows.delete(id);
    }
  }
}

function makeHead(methods, known) {
  columns = methods.join();
  keepOnly(new Set());
  $("corner-table").classList.toggle("compare", methods.length > 1);
  const quantities = quantitiesFor(methods);
  const titles = new Map(known.map(({ name, title }) => [name, title]));
  const groups = methods.map((name) => {
    const title = titles.get(name) ?? name;
    return el(
      "th",
      { scope: "colgroup", colSpan: quantities.length, class: "group", title },
      swatch(name),
      name,
      el("output", { class: "cost", "data-method": name, title: "Time this method took for the scan" }),
    );
  });
  const heads = methods.flatMap(() =>
    quantities.map(({ key, label, unit }) =>
      el("th", { scope: "col", class: key }, label, el("span", { class: "unit" }, ` ${unit}`)),
    ),
  );
  const corner = el("th", { scope: "col", rowSpan: 2, class: "corner" }, "Corner");
  $("corner-table").tHead.replaceChildren(el("tr", {}, corner, ...groups), el("tr", {}, ...heads));
}

function makeRow(id, methods) {
  const button = el("button", { type: "button", tabIndex: -1 }, `C${id}`);
  const cells = methods.flatMap(() => quantitiesFor(methods).map(({ key }) => el("td", { class: key }, "")));
  return el(
    "tr",
    { corner: id, button, values: cells },
    el("th", { scope: "row", class: "corner" }, button),
    ...cells,
  );
}

function fillRow(row, corner, methods) {
  let cell = 0;
  for (const method of methods) {
    const values = corner.by_method[method];
    for (const { key, text } of quantitiesFor(methods))
      setText(row.values[cell++], values ? text(values[key]) : "\u2013");
  }
}

let marked = null;

/** Highlights the selected row, brings it into view when it is newly selected, and keeps one row in the tab order. */
function markSelected(selection) {
  const corner = selection?.corner ?? null;
  const tabStop = rows.has(corner) ? corner : rows.keys().next().value;
  for (const [id, row] of rows) {
    row.classList.toggle("selected", id === corner);
    row.button.setAttribute("aria-pressed", String(id === corner));
    row.button.tabIndex = id === tabStop ? 0 : -1;
  }
  if (corner !== marked && rows.has(corner))
    rows.get(corner).scrollIntoView({ block: "nearest", inline: "nearest" });
  if (corner === null || rows.has(corner)) marked = corner;
}

function choose(row) {
  if (!row) return;
  row.button.focus({ preventScroll: true });
  select(row.corner === get("selection")?.corner ? null : row.corner);
}

function walk(event) {
  const by = { ArrowDown: 1, ArrowUp: -1, Home: -Infinity, End: Infinity }[event.key];
  if (!by) return;
  event.preventDefault();
  const body = event.currentTarget;
  const from = [...body.rows].indexOf(event.target.closest("tr"));
  const next = body.rows[Math.min(body.rows.length - 1, Math.max(0, from + by))];
  next.button.focus();
  if (next.corner !== get("selection")?.corner) select(next.corner);
}
