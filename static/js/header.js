// The instrument's readouts: connection, source and the figures of the newest frame.

import { $, el, setText } from "./dom.js";
import { quantile } from "./history.js";
import { nameOf, stateOf, stateText, troubleOf } from "./live.js";
import { on } from "./store.js";
import { showPanel } from "./tabs.js";
import { fixed, microseconds, milliseconds, percent } from "./units.js";

const CONNECTION = { connecting: "Connecting", open: "Connected", lost: "Connection lost" };

const READOUTS = [
  { key: "frame", label: "Frame", text: ({ frame }) => frame.sequence },
  { key: "rate", label: "Rate", text: (now) => `${fixed(rateOf(now), 1)}\u2009Hz` },
  { key: "latency", label: "Latency", text: () => milliseconds(quantile(({ age }) => age, 0.5)) },
  { key: "extract", label: "Extraction", text: ({ frame }) => microseconds(frame.timings.extract_us) },
  { key: "complete", label: "Complete", text: ({ frame }) => percent(frame.completeness) },
  { key: "beams", label: "Beams", text: ({ frame }) => `${frame.n_valid}\u2009/\u2009${frame.n_beams}` },
  { key: "segments", label: "Segments", text: ({ frame }) => frame.segments[frame.fitter]?.length ?? 0 },
  { key: "corners", label: "Corners", text: ({ frame }) => frame.corners.length },
  { key: "dropped", label: "Dropped", text: ({ frame }) => frame.dropped },
];

export function mountHeader() {
  const figures = READOUTS.map(({ key, label }) => [
    key,
    label,
    el("dd", { id: `readout-${key}` }, "\u2013"),
  ]);
  $("readouts").append(
    sourceReadout(),
    ...figures.map(([key, label, value]) =>
      el("div", { class: `readout ${key}-readout` }, el("dt", {}, label), value),
    ),
  );
  on(["frame", "source"], (frame, source) => {
    for (const { key, text } of READOUTS) setText($(`readout-${key}`), text({ frame, source }));
  });
  on(["connection"], (connection) => {
    $("connection").dataset.state = connection;
    setText($("connection"), CONNECTION[connection]);
  });
  on(["source"], drawSource);
  on(["connection", "ready", "source"], showBanner);
}

/** The name of what plays, with the state of a live source; it leads to the switch. */
function sourceReadout() {
  const onclick = () => showPanel("sources", { focus: true });
  const name = el("button", { type: "button", id: "readout-source", class: "state", onclick }, "\u2013");
  return el("div", { class: "readout source-readout" }, el("dt", {}, "Source"), el("dd", {}, name));
}

function drawSource(source) {
  const name = $("readout-source");
  setText(name, nameOf(source));
  name.dataset.state = stateOf(source);
  name.title = `${stateText(source)}. Choose what plays`;
  document.title = `${nameOf(source)} · lidarcore`;
}

/** What comes from the sensor, or else what is shown. */
const rateOf = ({ frame, source }) => source.device?.rate_hz ?? frame.rate_hz;

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
