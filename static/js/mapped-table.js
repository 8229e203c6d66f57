// The table of the walls of the map.

import { $, el, setText } from "./dom.js";
import { selectMapped, slant } from "./mapped.js";
import { selectableRows } from "./rows.js";
import { get, on } from "./store.js";
import { throttled } from "./throttle.js";
import { ago, degrees, metres, millimetres, wholeNumber } from "./units.js";

const MOST = 500; // in the table
const REDRAW_MS = 500;

const COLUMNS = [
  { key: "length", label: "Length m", text: ({ length }) => metres(length) },
  { key: "sigma", label: "σ mm", text: ({ length_variance: variance }) => millimetres(Math.sqrt(variance)) },
  { key: "direction", label: "Runs at °", text: (wall) => degrees(slant(wall)) },
  { key: "seen", label: "Seen", text: ({ count }) => wholeNumber(count) },
  { key: "age", label: "Ago", text: ({ last_seen: last }) => ago((get("frame")?.stamp ?? NaN) - last) },
];

let rows;

export function mountMappedTable() {
  const heads = COLUMNS.map(({ key, label }) => el("th", { scope: "col", class: key }, label));
  $("mapped-table").tHead.append(el("tr", {}, el("th", { scope: "col", class: "name" }, "Id"), ...heads));
  rows = selectableRows($("mapped-table").tBodies[0], {
    name: (id) => `W${id}`,
    cells: () => COLUMNS.map(({ key }) => el("td", { class: key }, "")),
    fill: (cells, wall) => cells.forEach((cell, at) => setText(cell, COLUMNS[at].text(wall))),
    choose: selectMapped,
  });
  const fill = throttled(REDRAW_MS, draw);
  on(["mapped"], ({ walls }) => setText($("mapped-count"), wholeNumber(walls.length)));
  on(["mapped", "frame", "panel"], ({ walls }, _, panel) => panel === "map" && fill(walls));
  on(["mappedWall"], (id) => rows.mark(id));
}

/** Selects the wall `by` rows further; the first or last one if none is selected. */
export const nextMapped = (by) => rows.step(by);

function draw(walls) {
  const sorted = [...walls].sort((a, b) => a.id - b.id);
  rows.update(sorted.slice(0, MOST));
  $("mapped-table").hidden = sorted.length === 0;
  setText($("mapped-note"), note(sorted.length));
}

function note(count) {
  if (count > MOST) return `Only the first ${MOST} are shown; saved files and the API have all of them.`;
  return count ? "" : "No wall is found yet.";
}
