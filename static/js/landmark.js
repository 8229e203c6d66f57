// The selected landmark: what is known of it, and how it became so.

import { request } from "./api.js";
import { $, el, iconButton, remake } from "./dom.js";
import { earlierFigure } from "./earlier.js";
import { makeFigure } from "./figure.js";
import { longestSigma } from "./pose.js";
import { select } from "./actions.js";
import { get, on } from "./store.js";
import { metres, millimetres, moment, squareMillimetres, wholeNumber } from "./units.js";

const REFRESH_MS = 2000;
const MOST = 1000; // states of the history

let shown = null; // the landmark with its history
let asked = { id: null, at: 0 };
let figure = null;

export function mountLandmark() {
  on(["selection", "landmarks", "panel"], refresh);
  on(["settings"], () => shown && draw());
}

/** Asks for the history of the selected landmark, anew while it changes. */
async function refresh({ landmark: id }, landmarks, panel) {
  if (!landmarks.has(id)) return show(null);
  if (shown && shown.id !== id) show(null);
  const isOld = landmarks.get(id).last_seen !== shown?.last_seen;
  const isDue = asked.id !== id || performance.now() - asked.at > REFRESH_MS;
  if (panel !== "map" || !isOld || !isDue) return;
  asked = { id, at: performance.now() };
  const found = await request("GET", `landmarks/${id}?limit=${MOST}`).catch(() => null); // it may be gone by now
  if (found?.landmark && get("selection").landmark === id)
    show({ ...found.landmark, history: found.history });
}

function show(landmark) {
  const isOther = landmark && landmark.id !== shown?.id;
  shown = landmark;
  if (!shown) asked = { id: null, at: 0 };
  draw();
  if (isOther) $("landmark").scrollIntoView({ block: "nearest" });
}

function draw() {
  remake($("landmark"), [shown, document.documentElement.dataset.theme], () => {
    figure?.remove();
    figure = shown && makeFigure(historyOf(shown));
    return shown ? [heading(shown), facts(shown), figure.node] : [];
  });
}

function heading({ id }) {
  const close = iconButton("close", "Close the details", () => select({ landmark: null }));
  close.dataset.key = "close";
  return el("h3", {}, `Landmark L${id}`, close);
}

function facts(landmark) {
  const { kind, method, x, y, var_x, cov_xy, var_y, count, first_seen, last_seen } = landmark;
  const lines = [
    ["Kind", [kind, method].filter(Boolean).join(", found by ")],
    ["Position", `${metres(x)}, ${metres(y)}\u2009m`],
    ["1σ, longest axis", `${millimetres(longestSigma(landmark))}\u2009mm`],
    ["Covariance xx, xy, yy", `${[var_x, cov_xy, var_y].map(squareMillimetres).join(", ")}\u2009mm²`],
    ["Seen", `${wholeNumber(count)} times, ${moment(first_seen)} to ${moment(last_seen)}`],
  ];
  const pairs = lines.map(([name, text]) => el("div", {}, el("dt", {}, name), el("dd", {}, text)));
  return el("dl", { class: "facts" }, ...pairs);
}

/** How far it was from where it is now, within the standard deviation it had. */
function historyOf({ x, y, history }) {
  return earlierFigure({
    title: "Earlier positions relative to the present one, mm",
    states: history,
    lines: [
      { label: "y", key: "across", tone: "--across", of: (then) => then.y - y },
      { label: "x", key: "along", tone: "--along", of: (then) => then.x - x },
    ],
    sigma: longestSigma,
  });
}
