// The instrument's readouts: connection, source and the figures of the newest frame.

import { $, el, setText } from "./dom.js";
import { on } from "./store.js";
import { fixed, microseconds } from "./units.js";

const CONNECTION = { connecting: "Connecting", open: "Live", lost: "Reconnecting" };

const READOUTS = [
  { key: "source", label: "Source", text: ({ source }) => nameOf(source) },
  { key: "frame", label: "Frame", text: ({ frame }) => frame.sequence },
  { key: "rate", label: "Rate", text: ({ frame }) => `${fixed(frame.rate_hz, 1)}\u2009Hz` },
  { key: "extract", label: "Extraction", text: ({ frame }) => microseconds(frame.timings.extract_us) },
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
  on(["source"], (source) => (document.title = `${nameOf(source)} · lidarcore`));
  on(["connection", "ready"], showBanner);
}

export const nameOf = (source) => (source.kind === "simulation" ? "Simulated room" : source.recording);

function showBanner(connection, ready) {
  const text =
    connection === "lost"
      ? "Connection lost. What you see is the last frame; reconnecting."
      : ready
        ? ""
        : "Compiling kernels. This takes a minute at the first start only.";
  $("banner").hidden = !text;
  setText($("banner"), text);
}
