// The instrument's readouts: connection, source and the figures of the newest frame.

import { isPlaying } from "./actions.js";
import { $, el, setText } from "./dom.js";
import { quantile } from "./history.js";
import { isStale, nameOf, stateOf, stateText, troubleOf } from "./live.js";
import { on } from "./store.js";
import { showPanel } from "./tabs.js";
import { COMPLETE_HINT, hertz, microseconds, milliseconds, percent, UNKNOWN } from "./units.js";

const CONNECTION = { connecting: "Connecting", open: "Connected", lost: "Connection lost" };

/** Figures of the frame shown, or (`now`) of what comes at present, which is not known when nothing comes; first those that a narrow page has room for. */
const READOUTS = [
  {
    key: "rate",
    label: "Rate",
    hint: "Scans a second",
    now: true,
    text: (now) => hertz(rateOf(now)),
  },
  { key: "corners", label: "Corners", text: ({ frame }) => frame.corners.length },
  { key: "segments", label: "Walls", text: ({ frame }) => frame.segments[frame.fitter]?.length ?? 0 },
  {
    key: "extract",
    label: "Extraction",
    hint: "Time to find walls and corners in this scan",
    text: ({ frame }) => microseconds(frame.timings.extract_us),
  },
  {
    key: "latency",
    label: "Latency",
    hint: "From the last byte of a scan to sending it to this page, median",
    now: true,
    text: ({ source }) => milliseconds(isPlaying(source) ? quantile(({ age }) => age, 0.5) : NaN),
  },
  {
    key: "frame",
    label: "Scans",
    hint: "Scans processed since the server started. While the number stands still, no scan arrives",
    text: ({ frame }) => frame.sequence,
  },
  {
    key: "beams",
    label: "Beams",
    hint: "Beams with a return, of all beams in this scan",
    text: ({ frame }) => `${frame.n_valid}\u2009/\u2009${frame.n_beams}`,
  },
  {
    key: "complete",
    label: "Complete",
    hint: COMPLETE_HINT,
    now: true,
    text: ({ frame }) => percent(frame.completeness),
  },
  {
    key: "dropped",
    label: "Dropped",
    hint: "Scans skipped because a newer one arrived while the server was busy",
    text: ({ frame }) => frame.dropped,
  },
];

export function mountHeader() {
  $("readouts").append(
    sourceReadout(),
    noiseRemark(),
    ...READOUTS.map(readout),
  );
  on(["frame"], ({ noise_remark: remark }) => {
    $("noise-remark").parentElement.hidden = !remark;
    setText($("noise-remark"), remark ? `${remark} Calibrate` : "");
  });
  on(["frame", "source", "connection"], (frame, source, connection) => {
    const stale = isStale(source, connection);
    $("readouts").classList.toggle("stale", stale);
    for (const { key, now, text } of READOUTS)
      setText($(`readout-${key}`), stale && now ? UNKNOWN : text({ frame, source }));
  });
  on(["connection"], (connection) => {
    $("connection").dataset.state = connection;
    setText($("connection"), CONNECTION[connection]);
  });
  on(["source", "connection"], drawSource);
  on(["connection", "ready", "source"], showBanner);
}

function readout({ key, label, hint = "" }) {
  const value = el("dd", { id: `readout-${key}` }, UNKNOWN);
  return el("div", { class: `readout ${key}-readout`, title: hint }, el("dt", {}, label), value);
}

/** The name of what plays, with the state of a live source; it leads to the switch. */
function sourceReadout() {
  const onclick = () => showPanel("sources", { focus: true });
  const name = el("button", { type: "button", id: "readout-source", class: "state", onclick }, UNKNOWN);
  return el("div", { class: "readout source-readout" }, el("dt", {}, "Source"), el("dd", {}, name));
}

/** Where what is seen contradicts what is set; it leads to the calibration. */
function noiseRemark() {
  const onclick = () => {
    showPanel("setup", { focus: true });
    $("calibration")?.scrollIntoView({ block: "start" });
  };
  const text = el("button", { type: "button", id: "noise-remark", class: "state", onclick });
  const title = "The ellipses are computed from this noise: if it is wrong, so are they";
  return el(
    "div",
    { class: "readout noise-readout", title, hidden: true },
    el("dt", {}, "Noise"),
    el("dd", {}, text),
  );
}

function drawSource(source, connection) {
  const name = $("readout-source");
  setText(name, nameOf(source));
  name.dataset.state = stateOf(source, connection);
  name.title = `${stateText(source, connection)}. Choose what plays`;
  document.title = `${nameOf(source)} · lidarcore`;
}

/** What comes from the sensor, or else what is shown, as long as anything plays. */
const rateOf = ({ frame, source }) => source.device?.rate_hz ?? (isPlaying(source) ? frame.rate_hz : NaN);

function showBanner(connection, ready, source) {
  const text =
    connection === "lost"
      ? "Connection lost. What you see is the last frame; reconnecting."
      : ready
        ? troubleOf(source)
        : "Compiling kernels. This takes a minute at the first start only.";
  $("banner").hidden = !text;
  setText($("banner"), text);
}
