// A form for each study: quick or full, and under "Options" whatever its schema has.

import { request } from "./api.js";
import { $, el, remake, setText } from "./dom.js";
import { fieldsOf } from "./schema.js";
import { on } from "./store.js";
import { report } from "./toasts.js";
import { duration, fineDegrees, millimetres } from "./units.js";

const LABELS = { scans: "Scans", runs: "Drives", trials: "Trials", seed: "Seed", topic: "Topic" };
const USUAL_NOISE = { consistency: "1, 2, 3, 5 cm" };

/** `refresh` is called when something was started. */
export function mountForms(refresh) {
  on(["studies"], ({ kinds }) =>
    remake(
      $("kinds"),
      kinds.map(({ name }) => name),
      () => kinds.map((kind) => study(kind, refresh)),
    ),
  );
  on(["studies"], ({ kinds, run }) => {
    for (const button of document.querySelectorAll("#kinds [type=submit]"))
      button.disabled = run?.state === "running";
    for (const { name, expected_s } of kinds)
      for (const [effort, seconds] of Object.entries(expected_s))
        setText($(`time-${name}-${effort}`), `about ${duration(seconds)}`);
  });
  on(["recordings", "studies"], (recordings) => {
    for (const list of document.querySelectorAll("#kinds select[name=recording]")) offer(list, recordings);
  });
  on(["settings", "studies"], ({ extraction: { noise } }) => {
    const text = `${millimetres(noise.sigma_range)} mm, ${fineDegrees(noise.sigma_bearing)}°`;
    for (const node of document.querySelectorAll("#kinds .noise-now")) setText(node, text);
  });
}

function study(kind, refresh) {
  const form = el("form");
  const fields = fieldsOf(kind.schema)
    .filter(({ key }) => key !== "quick")
    .sort((a, b) => (a.key === "seed") - (b.key === "seed")); // last
  form.append(
    efforts(kind),
    el("details", {}, el("summary", {}, "Options"), ...fields.map((field) => row(kind, field))),
    el("button", { type: "submit", class: "strong" }, "Run"),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    start(kind, chosen(form, fields), refresh);
  });
  form.addEventListener("change", ({ target }) => {
    if (target.name === "recording") suitNoise(form);
    showTopic(form);
  });
  showTopic(form);
  return el(
    "section",
    { class: "study", id: `study-${kind.name}`, "aria-labelledby": `title-${kind.name}` },
    el("h2", { id: `title-${kind.name}` }, kind.title),
    el("p", { class: "muted" }, kind.question),
    form,
  );
}

async function start(kind, options, refresh) {
  try {
    await request("POST", `studies/${kind.name}`, options);
    $("run").scrollIntoView({ block: "nearest" });
  } catch (problem) {
    report(problem, "The study was not started");
  }
  await refresh();
}

/** The options that differ from nothing: what is left empty is the server's choice. */
function chosen(form, fields) {
  const data = new FormData(form);
  const options = { quick: data.get("quick") === "quick" };
  for (const { key, integer } of fields) {
    const value = data.get(key);
    if (value) options[key] = integer ? Number(value) : value;
  }
  if (!options.recording) delete options.topic;
  return options;
}

function efforts({ name }) {
  const choices = ["quick", "full"].map((effort, i) =>
    choice("quick", effort, i === 0, [
      effort === "quick" ? "Quick" : "Full",
      el("small", { id: `time-${name}-${effort}` }),
    ]),
  );
  return group("Effort", choices);
}

function row(kind, field) {
  if (field.key === "noise") return noises(kind);
  const id = `${kind.name}-${field.key}`;
  const label = el("label", { for: id }, LABELS[field.key] ?? field.label);
  const control = field.key === "recording" ? recordingList(id) : input(id, field);
  return el("div", { class: `row ${field.key}-row`, title: field.description }, label, control);
}

function input(id, { key, integer, minimum, maximum, nullable, default: preset }) {
  if (!integer) return el("input", { id, name: key, type: "text", maxlength: "200", placeholder: "the only one" });
  return el("input", {
    id,
    name: key,
    type: "number",
    step: "1",
    min: String(minimum),
    max: String(maximum),
    placeholder: nullable ? "by effort" : "",
    required: !nullable,
    value: preset === null ? "" : String(preset),
  });
}

function recordingList(id) {
  return el("select", { id, name: "recording" }, el("option", { value: "" }, "None: simulated rooms"));
}

function offer(list, recordings) {
  const names = recordings.map(({ name }) => name);
  const value = list.value;
  remake(list, names, () => [
    el("option", { value: "" }, "None: simulated rooms"),
    ...names.map((name) => el("option", { value: name }, name)),
  ]);
  list.value = names.includes(value) ? value : "";
}

function noises({ name }) {
  const now = ["As set now", el("small", { class: "noise-now" })];
  const usual = ["Usual", el("small", {}, USUAL_NOISE[name] ?? "the papers'")];
  return group("Noise", [choice("noise", "usual", true, usual), choice("noise", "settings", false, now)]);
}

function group(legend, choices) {
  const set = el("fieldset", { class: "row segmented" });
  set.append(el("legend", {}, legend), el("span", { class: "segments" }, ...choices));
  return set;
}

function choice(name, value, checked, words) {
  const radio = el("input", { type: "radio", name, value, checked, class: "visually-hidden" });
  return el("label", {}, radio, el("span", {}, ...words));
}

/** A recording has its sensor's noise, simulated rooms the papers'. */
function suitNoise({ elements: { noise, recording } }) {
  noise.value = recording.value ? "settings" : "usual";
}

/** A topic is of a recording. */
function showTopic(form) {
  const topic = form.querySelector(".topic-row");
  if (topic) topic.hidden = !form.elements.recording.value;
}
