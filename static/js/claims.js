// What each method claims against what is so: a table with a plain verdict, and the verdict on the method in use.

import { KINDS } from "./boxes.js";
import { $, el, setText, swatch } from "./dom.js";
import { fixed, UNKNOWN } from "./units.js";

const FIGURES = [
  { key: "area_ratio", label: "claimed / scatter", factor: 1, digits: 2 },
  { key: "coverage_50", label: "in 50\u2009%", factor: 100, digits: 0 },
  { key: "coverage_95", label: "in 95\u2009%", factor: 100, digits: 1 },
  { key: "coverage_99", label: "in 99\u2009%", factor: 100, digits: 1 },
];

const MEANING = {
  "too small": "they are too small, and claim to know more than they do",
  true: "that is true, they can be believed",
  "too large": "they are too large, and claim to know less than they do",
};

/** The table, with its head. */
export function claimTable() {
  const heads = FIGURES.map(({ label }) => el("th", { scope: "col" }, label));
  const head = el(
    "tr",
    {},
    el("th", { scope: "col", class: "name" }, "Method"),
    ...heads,
    el("th", { scope: "col" }, "Ellipses are"),
  );
  const caption = el(
    "caption",
    { class: "visually-hidden" },
    "For each method and covariance: area of the claimed ellipses over that of the scatter, share of the scatter that " +
      "the ellipses of 50, 95 and 99 percent hold, each with its 95 percent confidence interval, and what that means.",
  );
  return el("table", { class: "listing", id: "repeatability-table" }, caption, el("thead", {}, head));
}

/** Writes the figures of a summary's methods, and the verdict on the one in use. */
export function drawClaims(methods, { fitter, covariance }) {
  const table = $("repeatability-table");
  for (const body of [...table.tBodies]) body.remove();
  table.append(...methods.map(bodyOf));
  const used = methods.find(({ name }) => name === fitter)?.claims[covariance];
  setText($("repeatability-verdict"), used ? sentence(fitter, covariance, used) : "");
  $("repeatability-verdict").dataset.verdict = used?.verdict ?? "";
  setText($("repeatability-hint"), hint(methods));
}

function bodyOf({ name, claims }) {
  const head = el(
    "th",
    { scope: "rowgroup", colSpan: FIGURES.length + 2, class: "group" },
    swatch(name),
    name,
  );
  return el("tbody", {}, el("tr", {}, head), ...KINDS.map((kind) => rowOf(kind, claims[kind])));
}

function rowOf(kind, { judgement, verdict }) {
  const cells = FIGURES.map((figure) => cellOf(judgement[figure.key], figure));
  const word = el("td", { class: "verdict", "data-verdict": verdict ?? "" }, verdict ?? UNKNOWN);
  return el("tr", {}, el("th", { scope: "row", class: "name" }, kind), ...cells, word);
}

/** A figure, and its interval below it. */
function cellOf({ value, low, high }, { factor, digits }) {
  const text = (figure) => fixed(figure === null ? NaN : factor * figure, digits);
  if (value === null) return el("td", {}, UNKNOWN);
  return el("td", {}, text(value), el("small", {}, `${text(low)}\u2013${text(high)}`));
}

function sentence(fitter, covariance, { judgement, verdict }) {
  if (!verdict) return "";
  const held = fixed(100 * judgement.coverage_95.value, 0);
  return `The ${covariance} 95\u2009% ellipses of ${fitter} hold ${held}\u2009% of the scatter: ${MEANING[verdict]}.`;
}

/** If even the exact covariances are wrong for all methods, it is the noise they are told. */
function hint(methods) {
  const verdicts = new Set(methods.map(({ claims }) => claims.consistent.verdict));
  const [verdict] = verdicts;
  if (verdicts.size > 1 || !(verdict in MEANING) || verdict === "true") return "";
  const noise = verdict === "too large" ? "less" : "more";
  return `Wrong by the same sign for all, even where the formula is exact: the sensor has ${noise} noise than Setup says.`;
}
