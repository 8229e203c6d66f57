// Where the sensor is: the state of the filter, the pose with its uncertainty, and what was matched.

import { comparison } from "./comparison.js";
import { $, el, remake, setText } from "./dom.js";
import { isStale } from "./live.js";
import { isSought } from "./pose.js";
import { on } from "./store.js";
import { DEGREE, degrees, fixed, metres, microseconds, spread, UNKNOWN, wholeNumber } from "./units.js";

const STATES = {
  starting: "Starting, too little seen so far",
  searching: "Not found in the map yet",
  tracking: "Tracking",
  coasting: "Coasting, not confirmed by what is in view",
  lost: "Lost, looking for a known place",
};

const MANY = 10; // scans skipped, by which a map suffers

/** A figure with its standard deviation. */
const POSE = [
  {
    key: "x",
    label: "x",
    value: ({ pose }) => `${metres(pose.x)}\u2009m`,
    sigma: (now) => offBy(now.covariance[0][0]),
  },
  {
    key: "y",
    label: "y",
    value: ({ pose }) => `${metres(pose.y)}\u2009m`,
    sigma: (now) => offBy(now.covariance[1][1]),
  },
  {
    key: "heading",
    label: "Heading",
    value: ({ pose }) => `${degrees(pose.heading)}°`,
    sigma: (now) => turnedBy(Math.sqrt(now.covariance[2][2])),
  },
];

const NIS_ABOUT =
  "If NIS is mostly below its band, the ellipses are larger than necessary: lower the noise or Unevenness. If it is mostly above, they are too small.";

const offBy = (variance) => `±\u2009${spread(Math.sqrt(variance))}`;

/** A heading that may be any is not known. */
const turnedBy = (sigma) => (sigma > Math.PI ? "unknown" : `±\u2009${fixed(sigma / DEGREE, 2)}°`);

const COUNTS = [
  { key: "confirmed", label: "Confirmed", hint: "Landmarks of the map", read: ({ confirmed }) => confirmed },
  {
    key: "tentative",
    label: "Tentative",
    hint: "Landmarks not seen often enough yet to be confirmed",
    read: ({ landmarks, confirmed }) => landmarks - confirmed,
  },
  {
    key: "matched",
    label: "Matched",
    hint: "Points of this scan matched to a landmark",
    read: ({ innovations }) => innovations.length,
  },
  {
    key: "ambiguous",
    label: "Ambiguous",
    hint: "Points of this scan that match several landmarks equally well, and are not used",
    read: ({ ambiguous }) => ambiguous,
  },
  {
    key: "unmatched",
    label: "Unmatched",
    hint: "Points of this scan that match no landmark",
    read: ({ unmatched }) => unmatched,
  },
  {
    key: "locate",
    label: "Time per scan",
    hint: "Time to estimate the pose and update the map, of the last scan that was new: one that is shown again takes none",
    read: () => took,
    text: microseconds,
  },
];

let took = null; // µs, by the last scan that was new

/** The figures, kept up to date. */
export function posePanel() {
  on(["frame", "settings", "source", "connection", "localization"], draw);
  return el(
    "div",
    { id: "pose-panel", hidden: true },
    stateLine(),
    poseList(),
    countList(),
    el("dl", { class: "facts", id: "comparison" }),
    el("p", { class: "muted", id: "nis-about" }, NIS_ABOUT),
  );
}

const stateLine = () =>
  el(
    "div",
    { role: "status" },
    el("p", { class: "state", id: "pose-panel-state" }),
    el("p", { id: "pose-panel-message" }),
  );

const poseList = () =>
  el(
    "dl",
    { class: "figures" },
    ...POSE.map(({ key, label }) =>
      el(
        "div",
        {},
        el("dt", {}, label),
        el("dd", { id: `pose-${key}` }, UNKNOWN),
        el("dd", { class: "sigma", id: `pose-sigma-${key}` }),
      ),
    ),
  );

const countList = () =>
  el(
    "dl",
    { class: "figures counts" },
    ...COUNTS.map(({ key, label, hint }) =>
      el("div", { title: hint }, el("dt", {}, label), el("dd", { id: `count-${key}` }, UNKNOWN)),
    ),
  );

let played = null; // the part of a recording that was played last: {index of its newest scan, dropped when it began}

/** What is said where a recording plays faster than a map can be made of it. */
function skippedText({ localization: now, dropped, source }) {
  if (!now || source.kind !== "recording") played = null;
  else if (!played || source.index < played.index) played = { index: source.index, dropped };
  else played.index = source.index;
  const skipped = played ? dropped - played.dropped : 0;
  if (skipped < MANY) return "";
  return `${wholeNumber(skipped)} scans were skipped: at this speed the map cannot keep up. Press Reset and play from the beginning at the speed max, which waits for every scan.`;
}

function draw(frame, { navigation }, source, connection, localization) {
  const { timings } = frame;
  const now = isOfRun(frame.localization, localization) ? frame.localization : null;
  took = timings.locate_us ?? took;
  $("count-locate").parentElement.hidden = took === null;
  $("pose-panel").hidden = navigation.mode === "off";
  if (navigation.mode === "off") return;
  const stale = isStale(source, connection);
  $("pose-panel").classList.toggle("stale", stale);
  $("pose-panel-state").dataset.state = stale || !now ? "" : now.state;
  setText(
    $("pose-panel-state"),
    stale ? "Unknown, no scans arrive. Last known pose:" : stateText(now, localization.problem),
  );
  const message = [now?.message, skippedText(frame)].filter(Boolean).join(" ");
  $("pose-panel-message").hidden = !message;
  setText($("pose-panel-message"), message);
  for (const { key, value, sigma } of POSE) {
    setText($(`pose-${key}`), hasPose(now) ? value(now) : UNKNOWN);
    setText($(`pose-sigma-${key}`), hasPose(now) ? sigma(now) : "");
  }
  for (const { key, read, text = wholeNumber } of COUNTS)
    setText($(`count-${key}`), now ? text(read(now)) : UNKNOWN);
  const lines = now ? comparison(now) : [];
  $("nis-about").hidden = !now?.dof;
  remake($("comparison"), lines, () =>
    lines.map(([label, text, hint]) => el("div", { title: hint }, el("dt", {}, label), el("dd", {}, text))),
  );
}

/** Whether a pose is of the mode and map that are set: they begin with a scan, and the frame before it stays until then. */
const isOfRun = (pose, { mode, session }) => pose?.mode === mode && (mode === "slam" || pose.session === session);

const hasPose = (now) => now && !isSought(now);

function stateText(now, problem) {
  if (!now) return problem ?? "Begins with the next scan";
  return STATES[isSought(now) ? "searching" : now.state];
}
