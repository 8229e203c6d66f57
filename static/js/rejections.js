// "Why is my wall missing?": what was rejected in the current frame, by reason.

import { $, el, setText } from "./dom.js";
import { throttled } from "./throttle.js";
import { placer } from "./overlay/world.js";
import { get, on, set } from "./store.js";
import { capital, fixed } from "./units.js";

const REFRESH_MS = 1000; // slower than the frames: these are sentences to read
const MOST = 60;
const KINDS = { segment: "Wall" };

export function mountRejections() {
  on(["frame"], ({ rejections }) => setText($("rejection-count"), rejections.length));
  const list = throttled(REFRESH_MS, draw);
  on(["panel"], (panel) => panel !== "rejections" && set("place", null));
  on(["frame", "panel"], (frame, panel) => panel === "rejections" && list(frame));
}

function draw({ rejections }) {
  const groups = Map.groupBy(rejections.slice(0, MOST), ({ kind, reason }) => `${KINDS[kind] ?? capital(kind)}: ${reason}`);
  const sections = [...groups].map(([title, items]) => group(title, items));
  const beyond = rejections.length - MOST;
  if (beyond > 0) sections.push(el("p", { class: "muted" }, `And ${beyond} more.`));
  if (!rejections.length) sections.push(el("p", { class: "empty" }, "Nothing was rejected in this scan."));
  $("rejection-list").replaceChildren(...sections);
}

function group(title, items) {
  const heading = el(
    "h3",
    {},
    title,
    el("span", { class: "count" }, ` ${items.length}`),
  );
  return el("section", {}, heading, el("ul", { class: "reasons" }, ...items.map(entry)));
}

/** A click on it shows where that was. */
function entry({ message, xy }) {
  if (!xy?.every(Number.isFinite)) return el("li", {}, message);
  const where = `at\u00a0(${fixed(xy[0], 2)},\u00a0${fixed(xy[1], 2)})\u00a0m`;
  const onclick = () => set("place", placer(get("frame").localization?.pose)(xy));
  return el("li", {}, el("button", { type: "button", class: "where", title: "Show the place", onclick }, message, el("small", {}, where)));
}
