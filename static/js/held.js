// How many of the sightings of a thing each method's 95 % ellipses hold, as a table; what cannot be chance is tinted.

import { KINDS } from "./boxes.js";
import { el, remake, swatch } from "./dom.js";
import { get } from "./store.js";

const EXPECTED = 0.95;

/** An empty table for `fillHeld`. */
export const heldTable = () => el("table", { class: "listing held" });

/** Shows what a summary says of a thing, {method: {count, claims}}, for the methods named. */
export function fillHeld(table, said, names) {
  const rows = names.filter((name) => said[name]).map((name) => [name, KINDS.map((kind) => cellOf(name, kind, said[name]))]);
  table.hidden = !rows.length;
  remake(table, rows, () => [head(), el("tbody", {}, ...rows.map(rowOf))]);
}

function cellOf(name, kind, { count, claims }) {
  const { value, low, high } = claims[kind].judgement.coverage_95;
  if (value === null) return { kind, text: "too few yet", title: "", verdict: "" };
  const inside = Math.round(value * count);
  const { title } = get("methods").find((method) => method.name === name);
  return {
    kind,
    text: `${inside} of ${count}`,
    title: `${title} ${kind}: ${inside} of ${count} inside, ${Math.round(EXPECTED * count)} expected`,
    verdict: high < EXPECTED ? "too small" : low > EXPECTED ? "too large" : "",
  };
}

function head() {
  const kinds = KINDS.map((kind) => el("th", { scope: "col" }, el("span", { class: `sign ${kind}`, "aria-hidden": "true" }), kind));
  return el("thead", {}, el("tr", {}, el("th", { scope: "col", class: "name" }, "Inside 95\u2009%"), ...kinds));
}

function rowOf([name, cells]) {
  const numbers = cells.map(({ kind, text, title, verdict }) =>
    el("td", { class: "verdict", title, "data-method": name, "data-kind": kind, "data-verdict": verdict }, text),
  );
  return el("tr", {}, el("th", { scope: "row", class: "name" }, swatch(name), name), ...numbers);
}
