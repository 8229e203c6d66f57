// Where the sensor is: the state of the filter, the pose with its uncertainty, what was matched, and the truth where
// there is one.

import { $, el, remake, setText } from "./dom.js";
import { isStale } from "./live.js";
import { errorOf, positionSigma } from "./pose.js";
import { isPlaying } from "./session.js";
import { on } from "./store.js";
import { degrees, fixed, metres, microseconds, millimetres, UNKNOWN, wholeNumber } from "./units.js";

const STATES = {
  starting: "Starting, not enough seen yet",
  tracking: "Tracking",
  coasting: "Coasting, nothing known is in sight",
  lost: "Lost, looking for a known place",
};

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
  "NIS mostly below its band: the ellipses are larger than they need be, lower the noise or Unevenness. Mostly above: they are smaller than true.";

const inMm = (variance) => `±\u2009${millimetres(Math.sqrt(variance))}\u2009mm`;

const COUNTS = [
  { key: "confirmed", label: "Confirmed", hint: "Landmarks of the map", read: ({ confirmed }) => confirmed },
  {
    key: "tentative",
    label: "Tentative",
    hint: "Landmarks seen too rarely yet to be relied upon",
    read: ({ landmarks, confirmed }) => landmarks - confirmed,
  },
  {
    key: "matched",
    label: "Matched",
    hint: "Points of this scan taken for a landmark",
    read: ({ innovations }) => innovations.length,
  },
  {
    key: "ambiguous",
    label: "Ambiguous",
    hint: "Points of this scan that might be one landmark or another, and are not used",
    read: ({ ambiguous }) => ambiguous,
  },
  {
    key: "unmatched",
    label: "Unmatched",
    hint: "Points of this scan that are no landmark of the map",
    read: ({ unmatched }) => unmatched,
  },
  {
    key: "locate",
    label: "Time per scan",
    hint: "Time to find the pose; of a scan shown again it is only looked up",
    read: (_, { locate_us }, source) => (isPlaying(source) ? locate_us : NaN),
    text: microseconds,
  },
];

/** The figures, kept up to date. */
export function whereabouts() {
  on(["frame", "settings", "source", "connection", "localization"], draw);
  return el(
    "div",
    { id: "whereabouts", hidden: true },
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
    el("p", { class: "state", id: "whereabouts-state" }),
    el("p", { id: "whereabouts-message" }),
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

function draw({ localization: now, timings }, { navigation }, source, connection, { problem }) {
  $("whereabouts").hidden = navigation.mode === "off";
  if (navigation.mode === "off") return;
  const stale = isStale(source, connection);
  $("whereabouts").classList.toggle("stale", stale);
  $("whereabouts-state").dataset.state = stale || !now ? "" : now.state;
  setText(
    $("whereabouts-state"),
    stale ? "Not known, no scan arrives. Last seen here:" : stateText(now, problem),
  );
  const message = now?.message ?? "";
  $("whereabouts-message").hidden = !message;
  setText($("whereabouts-message"), message);
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

/** A known map says nothing of the pose until something of it was recognized. */
const isPlaced = (now) => now && !(now.mode === "localize" && now.state === "starting");

const stateText = (now, problem) => (now ? STATES[now.state] : (problem ?? "Waiting for a scan"));

/** Lines of [label, text, hint] beside the estimate. */
function comparison(now) {
  const {
    velocity,
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
      `${fixed(velocity[0], 2)}\u2009m/s, ${degrees(velocity[1])}°/s`,
      "Estimated, with the turn rate",
    ],
    dof && [
      "NIS",
      `${fixed(nis, 1)} of ${dof}, 95 %: ${fixed(low, 0)} to ${fixed(high, 0)}`,
      "Normalized innovation squared, and between which bounds it lies 95 times in 100 if the filter is honest",
    ],
    reckoned && [
      "By odometry",
      poseText(reckoned),
      "Where odometry alone says the sensor is, and how far that is off",
    ],
    truth && ["In truth", poseText({ x: truth[0], y: truth[1], heading: truth[2] }), "As a reference says"],
    error && [
      "Error",
      errorText(error, now),
      "From the truth, beside the standard deviation along the longest axis",
    ],
  ].filter(Boolean);
}

const poseText = ({ x, y, heading }) =>
  `${fixed(x, 3)}, ${fixed(y, 3)}\u2009m${heading === null ? "" : `, ${degrees(heading)}°`}`;

function errorText({ distance, heading }, now) {
  const turn = heading === null ? "" : `, ${fixed((180 / Math.PI) * heading, 2)}°`;
  return `${millimetres(distance)}\u2009mm (1σ ${millimetres(positionSigma(now))})${turn}`;
}
