// Plots over time: stage times, corners and median ellipse area per method; of the filter, whether what it
// sees agrees with what it expects, and how sure it is.

import { token } from "./chart.js";
import { methodColour } from "./colours.js";
import { $, swatch } from "./dom.js";
import { line, makeFigure, stroke } from "./figure.js";
import { columns } from "./history.js";
import { throttled } from "./throttle.js";
import { errorOf, isOfScans, positionSigma } from "./pose.js";
import { on } from "./store.js";
import { fixed, microseconds, squareMillimetres, wholeMillimetres } from "./units.js";

const REDRAW_MS = 400;

const STAGES = [
  { key: "extract", label: "Extraction", tone: "--text" },
  { key: "draw", label: "Drawing", tone: "--edge" },
  { key: "cluster", label: "Clustering", tone: "--along" },
  { key: "locate", label: "Localization", tone: "--across" },
  { key: "age", label: "Scan to page", dash: [4, 3], tone: "--muted" },
];

const PLOTS = [
  { title: "Time per scan", series: stages, scale: "decades", text: microseconds },
  {
    title: "Corners",
    series: perMethod(({ corners }) => corners),
    scale: "counts",
    text: (value) => fixed(value, 0),
  },
  {
    title: "Median ellipse area, mm²",
    series: perMethod(({ median_area }) => median_area),
    scale: "decades",
    text: squareMillimetres,
  },
];

/** Of a filter of landmarks; whole scans have no innovations. */
const INNOVATION_PLOTS = [
  {
    title: "Squared innovations, normalised (NIS)",
    series: () => [
      line({ label: "NIS", key: "nis", tone: "--text", read: ofFilter(({ nis, dof }) => dof && nis) }),
    ],
    band: {
      label: "95 % of them, by chi-square",
      read: [0, 1].map((end) => ofFilter(({ nis_band, dof }) => dof && nis_band[end])),
    },
    scale: "counts",
    text: (value) => fixed(value, 0),
  },
  {
    title: "Innovations, mm",
    series: () => [
      line({ label: "ahead", key: "along", tone: "--along", dots: true, read: ({ dx }) => dx }),
      line({ label: "to the left", key: "across", tone: "--across", dots: true, read: ({ dy }) => dy }),
    ],
    rows: ({ localization }) => localization?.innovations ?? [],
    scale: "outlying",
    text: wholeMillimetres,
  },
];

const POSITION_PLOT = {
  title: "Position, mm",
  series: () => [
    line({ label: "1σ", key: "sigma", tone: "--text", read: ofFilter(positionSigma) }),
    line({
      label: "true error",
      key: "error",
      tone: "--bad",
      read: ofFilter((now) => errorOf(now)?.distance),
    }),
  ],
  scale: "decades",
  text: wholeMillimetres,
};

let figures = [];
let made = "";

export function mountPlots() {
  const draw = throttled(REDRAW_MS, redraw);
  on(["frame", "panel", "settings", "localization", "methods"], (frame, panel, { navigation }, localization) => {
    if (panel === "plots") draw(frame, isOfScans(navigation, localization));
  });
}

/** Reads a figure of the filter from a sample; nothing while it is off, or there is nothing to tell. */
function ofFilter(read) {
  return ({ localization }) => (localization && read(localization)) || null;
}

function stages() {
  return STAGES.map(({ key, ...stage }) => line({ ...stage, key, read: (sample) => sample[key] || null }));
}

function perMethod(figure) {
  return (methods) =>
    methods.map((name) => {
      const read = ({ summary }) => summary[name] && figure(summary[name]);
      return { label: name, colour: methodColour(name), mark: swatch(name), read };
    });
}

function redraw({ methods, localization }, ofScans) {
  const ofPose = localization ? [...(ofScans ? [] : INNOVATION_PLOTS), POSITION_PLOT] : [];
  const kinds = [...ofPose, ...PLOTS];
  const wanted = `${methods.join()} ${document.documentElement.dataset.theme} ${kinds.length}`;
  if (wanted !== made) make(kinds, methods);
  made = wanted;
  for (const figure of figures) figure.redraw();
}

function make(kinds, methods) {
  for (const figure of figures) figure.remove();
  figures = kinds.map((kind) => makeFigure(prepared(kind, methods)));
  $("plots").replaceChildren(...figures.map(({ node }) => node));
}

/** The main method comes last: it is drawn on top of the others. */
function prepared({ rows, band, ...kind }, methods) {
  const series = kind.series(methods).reverse();
  const readers = [...series, ...(band ? band.read.map((read) => ({ read })) : [])].map(({ read }) => read);
  const filled = band && { label: band.label, mark: stroke("band"), colour: token("--band") };
  return { ...kind, series, band: filled, columns: () => columns(readers, rows) };
}
