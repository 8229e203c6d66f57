// Measuring: two clicks that snap to corners and walls, both of the scan or both of the map; the server says how far they
// are from each other, and how sure.

import { attempt } from "../actions.js";
import { request } from "../api.js";
import { $, setText } from "../dom.js";
import { isMapFirst } from "../mapped.js";
import { get, on, set } from "../store.js";
import { degrees, metres, millimetres } from "../units.js";

const PARALLEL = 0.35; // rad between walls from which on they have no distance: they meet
const HINT = "Click two corners or walls";
const MIXED = "One is only in the scan, the other only in the map: click two of the scan, or two of the map";

/** Whether clicks measure; the store has {clicked, first, second, found} as "measure", null while they select. */
export const isMeasuring = () => Boolean(get("measure"));

/** What was measured is forgotten where another map or source is shown: nothing need be there. */
export function mountMeasure() {
  on(["source", "localization"], ({ kind, name }, { mode, session }) => {
    const now = [kind, name, mode, mode === "localize" && session].join();
    if (now !== shown && get("measure")?.first) {
      set("measure", {});
      say();
    }
    shown = now;
  });
}

let shown = ""; // source, and map that is localized in

export function toggleMeasure() {
  set("measure", isMeasuring() ? null : {});
  $("measure").setAttribute("aria-pressed", String(isMeasuring()));
  say();
}

/** Ends measuring. Returns whether it was on. */
export function cancelMeasure() {
  const was = isMeasuring();
  if (was) toggleMeasure();
  return was;
}

/** Takes what was clicked, {scan, map} as `measurableAt` says; the third click begins anew. */
export async function measureFrom(now) {
  const order = isMapFirst() ? ["map", "scan"] : ["scan", "map"];
  const shown = order.find((source) => now[source]);
  if (!shown) return say("Nothing to measure there: click a corner or a wall");
  const { clicked, second } = get("measure");
  if (!clicked || second) set("measure", { clicked: now, first: now[shown] });
  else {
    const common = order.find((source) => clicked[source] && now[source]);
    if (!common) return say(MIXED);
    await measure(clicked[common], now[common]);
  }
  say();
}

async function measure(first, second) {
  const [from, to] = [first, second].map(({ kind, at }) => `${kind}@${at.map((value) => value.toFixed(4)).join(",")}`);
  const found = await attempt(() => request("GET", `measure?first=${from}&second=${to}`), "This could not be measured");
  if (isMeasuring()) set("measure", found ? { first: found.first, second: found.second, found } : {});
}

/** "3.412 m ± 9 mm", the angle where there is one, and of walls that are not about parallel only that. */
export function measureText({ distance, sigma, angle, angle_sigma: turn }) {
  const length = `${metres(distance)}\u2009m ± ${millimetres(sigma)}\u2009mm`;
  if (angle === null) return length;
  const between = `${degrees(angle)}° ± ${degrees(turn)}°`;
  return angle > PARALLEL ? between : `${length}, ${between}`;
}

function say(words) {
  const measured = get("measure");
  $("measure-text").hidden = !measured;
  setText($("measure-text"), words ?? (measured?.found ? measureText(measured.found) : HINT));
}

/** Draws the line that is measured, and what it says. */
export function drawMeasure(pen, look, { ring, text, halo }) {
  const { first, second, found } = get("measure") ?? {};
  const ends = [first, second].filter(Boolean).map(({ at }) => look.toScreen(at)).filter(Boolean);
  for (const end of ends) pen.disc(end, 5, { stroke: ring, width: 2 });
  if (ends.length < 2) return;
  pen.path(ends, { stroke: ring, width: 2 });
  const [[x0, y0], [x1, y1]] = ends;
  const [x, y] = [(x0 + x1) / 2, (y0 + y1) / 2];
  const isSteep = Math.abs(y1 - y0) > Math.abs(x1 - x0); // words stand beside the line, on the side with more room
  const side = x > look.width / 2 ? -1 : 1;
  const [at, anchor] = isSteep ? [[x + 10 * side, y], side < 0 ? "end" : "start"] : [[x, y - 8], "middle"];
  pen.text(at, measureText(found), { fill: text, halo, anchor });
}
