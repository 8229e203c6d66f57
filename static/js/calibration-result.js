// What a calibration found: figures with 95 % intervals, noise by distance and incidence, and what to do with it.

import { el } from "./dom.js";
import { sameNoise, saveProfile, useNoise } from "./profiles.js";
import { drawing, roundStep, shape } from "./svg.js";
import { fixed, wholeNumber } from "./units.js";

const DEGREES = 180 / Math.PI;
const MM = 1e3;

const WIDTH = 360;
const LEFT = 92;
const RIGHT = 350;
const ROW = 18;
const TITLE = 22;
const MARGIN = 1.05; // times the largest value, to the end of the axis

/** The nodes of a result that came `from` somewhere, beside the noise that is set. */
export const calibrationResult = (result, from, noise) => [
  figures(result, from),
  ...result.remarks.map((remark) => el("p", { class: "muted remark" }, remark)),
  bandFigure(result),
  ...actions(result.noise, noise),
];

function figures(result, from) {
  const lines = [
    ["Range noise, 1σ", sigma(result.sigma_range, MM, 2, "mm")],
    ["Bearing noise, 1σ", sigma(result.sigma_bearing, DEGREES, 3, "°")],
    ["Outliers", spread(result.outliers, 100, 2, "%")],
    ["Range bias", spread(result.range_bias, MM, 1, "mm")],
    ["Alignment", spread(result.alignment, DEGREES, 2, "°")],
    ["Drift of a wall, at most", `${fixed(MM * result.drift, 1)}\u2009mm`],
    ["Made of", `${wholeNumber(result.beams)} beams on ${result.walls} walls, ${from}`],
  ];
  const pairs = lines.map(([name, text]) => el("div", {}, el("dt", {}, name), el("dd", { title: text }, text)));
  return el("dl", { class: "facts", "aria-label": "Result, with 95 % confidence intervals" }, ...pairs);
}

/** A noise whose interval begins at 0 cannot be distinguished from none. */
const sigma = (figure, factor, digits, unit) =>
  figure.low > 0
    ? spread(figure, factor, digits, unit)
    : `unknown, at most ${fixed(factor * figure.high, digits)}\u2009${unit}`;

function spread(figure, factor, digits, unit) {
  if (!figure) return "unknown";
  const shown = (x) => fixed(Number((factor * x).toFixed(digits)) || 0, digits); // no minus before 0
  const [value, low, high] = [figure.value, figure.low, figure.high].map(shown);
  return `${value}\u2009${unit} (${low} to ${high})`;
}

function bandFigure({ by_range: byRange, by_incidence: byIncidence }) {
  const bands = [
    { name: "distance", found: byRange, factor: 1, digits: 1, unit: "m" },
    { name: "incidence", found: byIncidence, factor: DEGREES, digits: 0, unit: "°" },
  ];
  const most = MARGIN * MM * Math.max(...bands.flatMap(({ found }) => found.sigmas.map(({ high }) => high)));
  const step = roundStep(most, 3);
  const x = (mm) => LEFT + ((RIGHT - LEFT) * mm) / most;
  const height = bands.reduce((sum, { found }) => sum + TITLE + ROW * found.sigmas.length, 0);
  const svg = drawing(WIDTH, height + 18, "bands");
  svg.setAttribute("aria-label", bands.map(describe).join(" "));
  for (let tick = 0; tick <= most; tick += step) {
    svg.append(
      shape("path", { class: "grid", d: `M${x(tick)} ${TITLE}V${height}` }),
      shape(
        "text",
        { class: "tick", x: x(tick), y: height + 14, "text-anchor": "middle" },
        tick ? String(Number(tick.toPrecision(3))) : "0 mm",
      ),
    );
  }
  let top = 0;
  for (const band of bands) {
    svg.append(shape("text", { class: "title", x: 0, y: top + 15 }, title(band)));
    top += TITLE;
    band.found.sigmas.forEach((sigma, at) => svg.append(...bar(band, sigma, at, top + ROW * (at + 0.5), x)));
    top += ROW * band.found.sigmas.length;
  }
  return svg;
}

function bar({ found, factor, digits, unit }, sigma, at, y, x) {
  const [low, value, high] = [sigma.low, sigma.value, sigma.high].map((m) => x(MM * m));
  return [
    shape("text", { x: 0, y: y + 4 }, between(found.edges, at, factor, digits, unit)),
    shape("path", { class: "interval", d: `M${low} ${y}H${high}` }),
    shape("circle", { class: "value", cx: value, cy: y, r: 2.5 }),
  ];
}

const between = (edges, at, factor, digits, unit) =>
  `${fixed(factor * edges[at], digits)} to ${fixed(factor * edges[at + 1], digits)}\u2009${unit}`;

const title = ({ name, found }) =>
  `Range noise by ${name}: ${found.differs ? "it differs" : "no difference is detected"}`;

const describe = (band) => {
  const { found, factor, digits, unit } = band;
  const told = found.sigmas.map(
    (sigma, at) => `${between(found.edges, at, factor, digits, unit)}: ${spread(sigma, MM, 2, "mm")}`,
  );
  return `${title(band)}. ${told.join(", ")}.`;
};

/** What to do with the noise that could be told, beside what is set where it could not: the systematic part never is. */
function actions(told, set) {
  if (told.sigma_range === null && told.sigma_bearing === null) return [];
  const found = { ...set, ...Object.fromEntries(Object.entries(told).filter(([, value]) => value !== null)) };
  const inUse = sameNoise(found, set);
  const use = el(
    "button",
    { type: "button", class: inUse ? "button" : "button strong", "data-key": "use", disabled: inUse, onclick: () => useNoise(found) },
    inUse ? "In use" : "Use",
  );
  const name = el("input", {
    type: "text",
    "aria-label": "Name of the profile",
    placeholder: "Name",
    "data-key": "name",
    required: true,
    maxLength: 100,
  });
  const save = (event) => {
    event.preventDefault();
    saveProfile(name.value.trim(), found);
  };
  const saving = el("button", { type: "submit", class: "button", "data-key": "save" }, "Save as profile");
  return [el("form", { class: "fields", id: "calibration-save", onsubmit: save }, use, name, saving)];
}
