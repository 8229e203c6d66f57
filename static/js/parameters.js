// Numeric settings made from the schema: a slider whose middle is the default, a number, a unit.

import { bind, idOf } from "./bindings.js";
import { $, el, setText } from "./dom.js";
import { setting, settings } from "./actions.js";
import { get, on } from "./store.js";
import { displayOf } from "./units.js";

const STEPS = 400;
const FLATTEST = 0.1; // power of a slider: below it, the end is all there is to choose
const LARGEST = 1e6; // of a slider's values
const MUCH_MORE = 1.5; // times the noise told: beyond what one scan's estimate is off by chance
const NOISE_LABELS = {
  sigma_range: "Range",
  sigma_bearing: "Bearing",
  range_growth: "Growth with range",
  unevenness: "Unevenness",
  unevenness_length: "Unevenness length",
  systematic: "Systematic",
};

export function mountParameters() {
  on(["fields"], (fields) => {
    const numeric = fields.filter(isExtractionNumber);
    fill(
      $("noise"),
      numeric.filter(isNoise).map((field) => ({ ...field, label: NOISE_LABELS[field.key] ?? field.label })),
    );
    fill(
      $("segmentation"),
      numeric.filter((field) => !isNoise(field)),
    );
    $("segmentation").append(resetButton());
    $("noise").append(el("p", { class: "muted", id: "noise-seen" }));
  });
  on(["frame", "settings", "fields"], (frame) => {
    const told = setting("extraction.noise.sigma_range");
    const doubt =
      frame.noise_seen > MUCH_MORE * told ? ": more than the setting, so the ellipses are too small" : "";
    setText(
      $("noise-seen"),
      `Range noise seen in this scan: ${(1e3 * frame.noise_seen).toFixed(1)} mm${doubt}.`,
    );
  });
  on(["settings", "fields"], () => {
    $("reset").disabled = get("fields").filter(isExtractionNumber).every(isDefault);
  });
}

/** Number fields of extraction: those this panel shows and a link carries. */
export const isExtractionNumber = ({ path, maximum }) =>
  path.startsWith("extraction.") && maximum !== undefined;

const isNoise = ({ path }) => path.includes(".noise.");

const isDefault = (field) => setting(field.path) === field.default;

/** Few need these; the others come first. */
const FOR_EXPERTS = ["split_threshold", "gap", "corner_angle", "range_growth", "unevenness", "unevenness_length", "systematic", "tails", "renewal", "resampling"];

function fill(section, fields) {
  const isFolded = ({ key }) => FOR_EXPERTS.includes(key);
  const rows = (chosen) => chosen.map((field) => parameterRow(field));
  const heading = section.querySelector("h2");
  section.replaceChildren(
    heading,
    ...rows(fields.filter((field) => !isFolded(field))),
    el("details", {}, el("summary", { "aria-label": `For experts: ${heading.textContent}` }, "For experts"), ...rows(fields.filter(isFolded))),
  );
}

/** A row of label, slider, number and unit for one numeric field of the schema; `empty` says what none means. */
export function parameterRow(field, { empty = "", model } = {}) {
  const { unit, scale, digits } = displayOf(field);
  const id = idOf(field.path);
  const minimum = field.minimum ?? field.above + scale * 10 ** -digits;
  const text = (value) => (value === null ? "" : String(Number((value / scale).toFixed(digits))));
  const number = el("input", {
    type: "number",
    id,
    min: text(minimum),
    max: text(field.maximum),
    step: field.integer ? "1" : "any",
    placeholder: empty,
    required: !field.nullable,
    inputmode: "decimal",
    "aria-describedby": `${id}-hint`,
  });
  const read = (shown) => (shown === "" ? null : tidy(Number(shown) * scale));
  bind(number, field.path, { show: text, read, model });
  return el(
    "div",
    { class: "row parameter", title: field.description },
    el("label", { for: id }, field.label, el("span", { class: "visually-hidden" }, unit && ` in ${unit}`)),
    powerOf(field, minimum) > FLATTEST ? slider(field, minimum, { unit, text, model }) : el("span"),
    number,
    el("span", { class: "unit", "aria-hidden": "true" }, unit),
    el("small", { class: "hint", id: `${id}-hint` }, field.description),
  );
}

/** Which power of the slider's position puts the default in the middle; 0 if none does, or there is no end to it. */
function powerOf({ default: preset, maximum, nullable }, minimum) {
  const part = (preset - minimum) / (maximum - minimum);
  if (nullable || maximum > LARGEST) return 0;
  return part > 0 && part < 1 ? Math.log(part) / Math.log(0.5) : 1;
}

/** A slider along a power curve. */
function slider(field, minimum, { unit, text, model }) {
  const span = field.maximum - minimum;
  const power = powerOf(field, minimum);
  const valueAt = (position) => minimum + span * (position / STEPS) ** power;
  const positionOf = (value) => STEPS * ((value - minimum) / span) ** (1 / power);
  const read = (position) => {
    const rounded = field.integer ? Math.round(valueAt(position)) : Number(valueAt(position).toPrecision(2));
    return Math.min(field.maximum, Math.max(minimum, rounded));
  };
  const show = (value) => {
    range.setAttribute("aria-valuetext", `${text(value)} ${unit}`);
    return positionOf(value);
  };
  const range = el("input", { type: "range", min: "0", max: String(STEPS), "aria-label": `${field.label} slider` });
  return bind(range, field.path, { show, read: (position) => read(Number(position)), model });
}

const tidy = (value) => Number(value.toPrecision(12));

function resetButton() {
  const reset = () => {
    const numeric = get("fields").filter(isExtractionNumber);
    const extraction = numeric.reduce((change, field) => assign(change, field), {});
    settings.patch({ extraction });
  };
  return el("button", { type: "button", class: "button", id: "reset", onclick: reset }, "Reset to defaults");
}

function assign(change, { path, key, default: preset }) {
  if (isNoise({ path })) return { ...change, noise: { ...change.noise, [key]: preset } };
  return { ...change, [key]: preset };
}
