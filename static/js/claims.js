// What each method claims against what is so: a table with a plain verdict, and the verdict on the method in use.

import { KINDS } from "./boxes.js";
import { startCalibration } from "./calibration.js";
import { $, el, remake, setText, swatch } from "./dom.js";
import { showPanel } from "./tabs.js";
import { capital, fixed, UNKNOWN } from "./units.js";

const FIGURES = [
  { key: "area_ratio", label: "claimed / real", factor: 1, digits: 2 },
  { key: "coverage_50", label: "in 50\u2009%", factor: 100, digits: 0 },
  { key: "coverage_95", label: "in 95\u2009%", factor: 100, digits: 1 },
  { key: "coverage_99", label: "in 99\u2009%", factor: 100, digits: 1 },
];

const MEANING = {
  "too small": "they are too small and claim too much certainty",
  true: "they match the scatter and can be trusted",
  "too large": "they are too large and claim too little certainty",
  open: "the scatter does not tell yet whether they are true",
};

const NOISE = { "too small": "more", "too large": "less" };

const CORNERS = "repeatability-table";

/** A table of claims with its head; of the corners, if no other id is given. */
export function claimTable(id = CORNERS) {
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
  return el("table", { class: "listing", id }, caption, el("thead", {}, head));
}

/** Writes the figures of a summary's methods, and the verdict on the one in use. */
export function drawClaims(methods, extraction) {
  drawTable(methods, extraction, CORNERS, "repeatability-verdict");
  drawHint(wrongForAll(methods));
}

/** Writes a table and the verdict on the method in use. */
export function drawTable(methods, { fitter, covariance }, id, verdict) {
  const table = $(id);
  for (const body of [...table.tBodies]) body.remove();
  table.append(...methods.map(bodyOf));
  const used = methods.find(({ name }) => name === fitter)?.claims[covariance];
  const said = used ? sentence(fitter, covariance, used) : "";
  const others = used ? othersOff(methods, fitter, covariance) : [];
  remake($(verdict), [said, others], () => [said, ...others.map(([size, text]) => el("span", { class: "verdict", "data-verdict": size }, text))]);
  $(verdict).dataset.verdict = used?.verdict ?? "";
}

/** What to do if all are wrong: it stands above the table, whose words then say little. */
export function calibrateHint() {
  const onclick = () => {
    showPanel("setup", { focus: true });
    $("calibration").scrollIntoView({ block: "start" });
    startCalibration();
  };
  return el(
    "div",
    { id: "repeatability-hint", class: "notice", hidden: true },
    el("p"),
    el("button", { type: "button", onclick }, "Calibrate"),
  );
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
  const [half, most] = ["coverage_50", "coverage_95"].map((key) => fixed(100 * judgement[key].value, 0));
  return (
    `The ${covariance} 95\u2009% ellipses of ${fitter} hold ${most}\u2009% of the scatter, ` +
    `and those of 50\u2009% hold ${half}\u2009%: ${MEANING[verdict]}.`
  );
}

/** Which of the other methods' ellipses are of a wrong size, and how much of the scatter they hold. */
function othersOff(methods, fitter, covariance) {
  const off = (size) =>
    methods
      .filter(({ name, claims }) => name !== fitter && claims[covariance].verdict === size)
      .map(({ name, claims }) => `${name} ${fixed(100 * claims[covariance].judgement.coverage_95.value, 0)}\u2009%`);
  const sizes = Object.keys(NOISE).filter((size) => off(size).length);
  return sizes.map((size) => [size, ` ${capital(size)}: ${off(size).join(", ")}.`]);
}

/** How even the exact covariances are wrong for all methods, if they are: it is the noise they are told. */
function wrongForAll(methods) {
  const [verdict, ...others] = new Set(methods.map(({ claims }) => claims.consistent.verdict));
  return others.length === 0 && NOISE[verdict] ? verdict : null;
}

function drawHint(verdict) {
  const hint = $("repeatability-hint");
  hint.hidden = !verdict;
  $("repeatability").classList.toggle("doubted", Boolean(verdict));
  if (!verdict) return;
  setText(
    hint.firstElementChild,
    `The consistent ellipses of all methods are ${verdict}: the sensor has ${NOISE[verdict]} noise than Setup says. ` +
      "Calibrate first; until then the verdicts below mean little.",
  );
}
