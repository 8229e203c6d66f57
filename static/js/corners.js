// The table of corners: one row each, for every method its position, deviations and ellipse area.

import { $, el, setText, swatch } from "./dom.js";
import { selectableRows } from "./rows.js";
import { select } from "./session.js";
import { on } from "./store.js";
import { degrees, metres, microseconds, millimetres, squareMillimetres, UNKNOWN } from "./units.js";

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

let columns = ""; // the methods the header is made for
let rows;

export function mountCorners() {
  rows = selectableRows($("corner-table").tBodies[0], {
    name: (id) => `C${id}`,
    cells: ({ methods }) =>
      methods.flatMap(() => quantitiesFor(methods).map(({ key }) => el("td", { class: key }, ""))),
    fill,
    choose: (corner) => select({ corner }),
  });
  on(["frame", "methods"], draw);
  on(["selection"], ({ corner }) => rows.mark(corner));
}

/** Selects the corner `by` rows further; the first or last one if none is selected. */
export const nextCorner = (by) => rows.step(by);

function draw({ methods, corners, timings }, known) {
  if (methods.join() !== columns) makeHead(methods, known);
  for (const cost of $("corner-table").tHead.querySelectorAll(".cost")) {
    setText(cost, microseconds(timings.per_method[cost.dataset.method]));
  }
  const sorted = [...corners].sort((a, b) => a.id - b.id);
  rows.update(sorted.map(({ id, by_method }) => ({ id, by_method, methods })));
  setText($("corner-count"), corners.length);
  $("corner-none").hidden = corners.length > 0;
}

function makeHead(methods, known) {
  columns = methods.join();
  rows.update([]);
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
  const corner = el("th", { scope: "col", rowSpan: 2, class: "name" }, "Corner");
  $("corner-table").tHead.replaceChildren(el("tr", {}, corner, ...groups), el("tr", {}, ...heads));
}

function fill(cells, { by_method, methods }) {
  let cell = 0;
  for (const method of methods) {
    const values = by_method[method];
    for (const { key, text } of quantitiesFor(methods))
      setText(cells[cell++], values ? text(values[key]) : UNKNOWN);
  }
}
