// The answer of a comparison: for each method, the area of its ellipses over that of the scatter, and how much of the
// scatter its ellipses of 95 % hold. The method that is off by most is tinted, unless it may be true.

import { changeSetting, setting } from "./actions.js";
import { $, el, setText } from "./dom.js";
import { get } from "./store.js";
import { fixed, ratio } from "./units.js";

const QUESTIONS = [
  {
    key: "area_ratio",
    label: "claimed / real area",
    title: "Area of the claimed ellipses over that of the scatter: 1 if they are true",
    text: ratio,
    off: (value) => Math.abs(Math.log(value)),
  },
  {
    key: "coverage_95",
    label: "inside 95\u2009%",
    title: "How much of the scatter the 95 % ellipses hold: 95 % if they are true",
    text: (value) => `${fixed(100 * value, 0)}\u2009%`,
    off: (value) => Math.abs(value - 0.95),
  },
];
const idOf = (key, method) => `answer-${key}-${method}`;

/** Rows of the table's head, a cell for each method over `each` columns; until there is an answer, how to get it. */
export function answerRows(methods, { before, each, after }) {
  const rows = QUESTIONS.map(({ key, label, title }) =>
    el(
      "tr",
      { class: "answer", title, hidden: true },
      el("th", { scope: "row", colSpan: before }, label),
      ...methods.map((name) => el("td", { id: idOf(key, name), colSpan: each }, "")),
      el("td", { colSpan: after }),
    ),
  );
  const ask = el("button", { type: "button", onclick: () => changeSetting("repeatability.running", true) }, "Compare with the next scans");
  const words = el("td", { colSpan: before + methods.length * each + after }, "Which ellipses are true? Keep the sensor still. ", ask);
  return [...rows, el("tr", { class: "asking", hidden: true }, words)];
}

/** Writes what repeatability says, of the covariance that is shown. */
export function drawAnswer({ methods }, { methods: judged }) {
  if (methods.length < 2) return;
  const isAsked = get("settings").repeatability.running || judged.some(({ corners }) => corners.length);
  for (const row of $("corner-table").tHead.querySelectorAll(".answer")) row.hidden = !isAsked;
  for (const row of $("corner-table").tHead.querySelectorAll(".asking")) row.hidden = isAsked;
  const kind = setting("extraction.covariance");
  const claims = new Map(judged.map(({ name, claims }) => [name, claims[kind]]));
  for (const { key, text, off } of QUESTIONS) {
    const values = methods.map((name) => claims.get(name)?.judgement[key].value ?? null);
    const wrong = methods.map((name, i) => (isWrong(claims.get(name)) && values[i] !== null ? off(values[i]) : 0));
    const worst = Math.max(...wrong);
    methods.forEach((name, i) => {
      const cell = $(idOf(key, name));
      if (!cell) return; // the head is made with the next frame
      setText(cell, values[i] === null ? "\u2013" : text(values[i]));
      cell.classList.toggle("worst", worst > 0 && wrong[i] === worst);
    });
  }
}

const isWrong = (claim) => claim?.verdict === "too small" || claim?.verdict === "too large";
