// The table of corners: one row each, with position, deviations and ellipse area. A comparison begins with its answer:
// how the ellipses of each method fit the scatter; the corners below are the detail, on a phone the areas alone.

import { answerRows, drawAnswer } from "./answer.js";
import { $, el, setText, swatch } from "./dom.js";
import { selectableRows } from "./rows.js";
import { select } from "./actions.js";
import { get, on, set } from "./store.js";
import { degrees, ellipseArea, metres, millimetres, UNKNOWN } from "./units.js";

const PLACE = [
  { key: "x", label: "x", unit: "m", text: metres },
  { key: "y", label: "y", unit: "m", text: metres },
];
const SIGMAS = [
  { key: "sigma_x", label: "σx", unit: "mm", text: millimetres },
  { key: "sigma_y", label: "σy", unit: "mm", text: millimetres },
];
const AREA = [{ key: "area", label: "area", unit: "mm²", text: ellipseArea }];
const ANGLE = [{ key: "angle", label: "angle", unit: "°", text: degrees }];

const NARROW = matchMedia("(max-width: 479px)");

/** What each method claims: of several, a phone has room for the areas. */
const claimsOf = (methods) => (get("narrow") && methods.length > 1 ? AREA : [...SIGMAS, ...AREA]);

/** The columns: {method, quantity}; where a corner is and its angle are told once, by the first method that has it. */
const columnsFor = (methods) => [
  ...PLACE.map((quantity) => ({ quantity })),
  ...methods.flatMap((method) => claimsOf(methods).map((quantity) => ({ method, quantity }))),
  ...ANGLE.map((quantity) => ({ quantity })),
];

const DENSE = 3; // methods beyond which the columns have to be narrow
let columns = ""; // what the header is made for: the methods, and whether there is little room
let rows;

export function mountCorners() {
  rows = selectableRows($("corner-table").tBodies[0], {
    name: (id) => `C${id}`,
    cells: ({ methods }) => columnsFor(methods).map(({ quantity }) => el("td", { class: quantity.key }, "")),
    fill,
    choose: (corner) => select({ corner }),
  });
  set("narrow", NARROW.matches);
  NARROW.addEventListener("change", () => set("narrow", NARROW.matches));
  on(["frame", "methods", "narrow"], draw);
  on(["selection"], ({ corner }) => rows.mark(corner));
  on(["frame", "repeatability", "narrow"], drawAnswer);
}

/** Selects the corner `by` rows further; the first or last one if none is selected. */
export const nextCorner = (by) => rows.step(by);

function draw({ methods, corners }, known) {
  if (keyOf(methods) !== columns) makeHead(methods, known);
  const sorted = [...corners].sort((a, b) => a.id - b.id);
  rows.update(sorted.map(({ id, by_method }) => ({ id, by_method, methods })));
  setText($("corner-count"), corners.length);
  $("corner-none").hidden = corners.length > 0;
}

const keyOf = (methods) => [get("narrow"), ...methods].join();

function makeHead(methods, known) {
  columns = keyOf(methods);
  rows.update([]);
  const each = claimsOf(methods).length;
  $("corner-table").classList.toggle("dense", get("narrow") || methods.length > DENSE);
  const titles = new Map(known.map(({ name, title }) => [name, title]));
  const groups = methods.map((name) => {
    const title = titles.get(name) ?? name;
    return el("th", { scope: "colgroup", colSpan: each, class: "group", title }, swatch(name), ...breakable(name));
  });
  setText($("corner-units"), `Sensor frame: x, y in m;${each > 1 ? " σ in mm;" : ""} area of the 1σ ellipse in mm²`);
  const heads = columnsFor(methods).map(({ quantity: { key, label, unit } }) =>
    el("th", { scope: "col", class: key }, label, el("span", { class: "unit" }, ` ${unit}`)),
  );
  const answers = methods.length > 1 ? answerRows(methods, { before: PLACE.length, each, after: ANGLE.length }) : [];
  const corner = el("th", { scope: "col", rowSpan: 2 + answers.length, class: "name" }, "Corner");
  const gap = (width) => el("td", { colSpan: width });
  $("corner-table").tHead.replaceChildren(
    el("tr", {}, corner, gap(PLACE.length), ...groups, gap(ANGLE.length)),
    ...answers,
    el("tr", {}, ...heads),
  );
}

/** A name of several words may break after each. */
const breakable = (name) => name.split(/(?<=_)/).flatMap((word) => [word, el("wbr")]);

function fill(cells, { by_method, methods }) {
  const first = methods.find((name) => by_method[name]);
  columnsFor(methods).forEach(({ method = first, quantity: { key, text } }, at) => {
    const values = by_method[method];
    setText(cells[at], values ? text(values[key]) : UNKNOWN);
  });
}
