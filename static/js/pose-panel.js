// Where the sensor is: the state of the filter, the pose with its uncertainty, what was matched, and the truth where
// there is one.

import { $, el, remake, setText } from "./dom.js";
import { isStale } from "./live.js";
import { errorOf, positionSigma } from "./pose.js";
import { isPlaying } from "./actions.js";
import { on } from "./store.js";
import { degrees, fixed, metres, microseconds, millimetres, UNKNOWN, wholeNumber } from "./units.js";

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
    sigma: (now) => inMm(now.covariance[0][0]),
  },
  {
    key: "y",
    label: "y",
    value: ({ pose }) => `${metres(pose.y)}\u2009m`,
    sigma: (now) => inMm(now.covariance[1][1]),
  },
  {
    key: "heading",
    label: "Heading",
    value: ({ pose }) => `${degrees(pose.heading)}°`,
    sigma: ({ covariance }) => `±\u2009${fixed((180 / Math.PI) * Math.sqrt(covariance[2][2]), 2)}°`,
  },
];

const NIS_ABOUT =
  "If NIS is mostly below its band, the ellipses are larger than necessary: lower the noise or Unevenness. If it is mostly above, they are too small.";

const inMm = (variance) => `±\u2009${millimetres(Math.sqrt(variance))}\u2009mm`;

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
    hint: "Time to estimate the pose and update the map",
    read: (_, { locate_us }, source) => (isPlaying(source) ? locate_us : NaN),
    text: microseconds,
  },
];

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

function draw(frame, { navigation }, source, connection, { problem }) {
  const { localization: now, timings } = frame;
  $("pose-panel").hidden = navigation.mode === "off";
  if (navigation.mode === "off") return;
  const stale = isStale(source, connection);
  $("pose-panel").classList.toggle("stale", stale);
  $("pose-panel-state").dataset.state = stale || !now ? "" : now.state;
  setText(
    $("pose-panel-state"),
    stale ? "Unknown, no scans arrive. Last known pose:" : stateText(now, problem),
  );
  const message = [now?.message, skippedText(frame)].filter(Boolean).join(" ");
  $("pose-panel-message").hidden = !message;
  setText($("pose-panel-message"), message);
  for (const { key, value, sigma } of POSE) {
    setText($(`pose-${key}`), isPlaced(now) ? value(now) : UNKNOWN);
    setText($(`pose-sigma-${key}`), isPlaced(now) ? sigma(now) : "");
  }
  for (const { key, read, text = wholeNumber } of COUNTS)
    setText($(`count-${key}`), now ? text(read(now, timings, source)) : UNKNOWN);
  const lines = now ? comparison(now) : [];
  $("nis-about").hidden = !now?.dof;
  remake($("comparison"), lines, () =>
    lines.map(([label, text, hint]) => el("div", { title: hint }, el("dt", {}, label), el("dd", {}, text))),
  );
}

/** A known map says nothing of the pose until something of it was recognised. */
const isPlaced = (now) => now && !(now.mode === "localize" && now.state === "starting");

function stateText(now, problem) {
  if (!now) return problem ?? "Waiting for a scan";
  return STATES[now.mode === "localize" && now.state === "starting" ? "searching" : now.state];
}

/** Lines of [label, text, hint] beside the estimate. */
function comparison(now) {
  const {
    velocity,
    sideways,
    dead_reckoned: reckoned,
    truth,
    nis,
    dof,
    nis_band: [low, high],
  } = now;
  const error = errorOf(now);
  return [
    velocity && [
      "Speed",
      `${fixed(Math.hypot(velocity[0], sideways), 2)}\u2009m/s, ${degrees(velocity[1])}°/s`,
      "Estimated, in whatever direction, with the turn rate",
    ],
    dof && [
      "NIS",
      `${fixed(nis, 1)} of ${dof}, 95 %: ${fixed(low, 0)} to ${fixed(high, 0)}`,
      "Normalized innovation squared, and the interval that holds 95 % of its values if the filter is consistent",
    ],
    reckoned && [
      "Odometry only",
      poseText(reckoned),
      "The pose from odometry alone",
    ],
    truth && ["True pose", poseText({ x: truth[0], y: truth[1], heading: truth[2] }), "From the simulator or a reference system"],
    error && [
      "Error",
      errorText(error, now),
      "Distance from the true pose, and the standard deviation along the longest axis",
    ],
  ].filter(Boolean);
}

const poseText = ({ x, y, heading }) =>
  `${fixed(x, 3)}, ${fixed(y, 3)}\u2009m${heading === null ? "" : `, ${degrees(heading)}°`}`;

function errorText({ distance, heading }, now) {
  const turn = heading === null ? "" : `, ${fixed((180 / Math.PI) * heading, 2)}°`;
  return `${millimetres(distance)}\u2009mm (1σ ${millimetres(positionSigma(now))})${turn}`;
}
