// The robot's own body: sectors in which what is near is left out, suggested by the server or given as rows of numbers.

import { attempt, changeSetting, setting } from "./actions.js";
import { request } from "./api.js";
import { $, el, iconButton, remake } from "./dom.js";
import { on } from "./store.js";
import { toast } from "./toasts.js";
import { DEGREE } from "./units.js";

const MOST = 16;
const NEW = { first: -10 * DEGREE, last: 10 * DEGREE, reach: 0.5 }; // ahead
const NUMBERS = [
  { key: "first", label: "From, °", scale: DEGREE, digits: 1, min: -360, max: 360 },
  { key: "last", label: "To, °", scale: DEGREE, digits: 1, min: -360, max: 360 },
  { key: "reach", label: "Reach, m", scale: 1, digits: 3, min: 0.01, max: 10 },
];
const ABOUT =
  "In these sectors the sensor sees the robot that carries it: whatever is nearer than the reach is left out before anything else is computed. 0° is straight ahead, and angles grow to the left. For a suggestion, let the robot drive and turn for some seconds.";

const list = el("div", { id: "mask-sectors" });
const button = (text, onclick) => el("button", { type: "button", class: "button", onclick }, text);
const add = button("Add a sector", () => change([...mask(), NEW]));
const clear = button("Clear", () => change([]));

const mask = () => setting("sensor.mask") ?? [];
const change = (sectors) => changeSetting("sensor.mask", sectors);

export function mountMask() {
  $("mask").append(
    el("p", { class: "muted about" }, ABOUT),
    list,
    el("div", { class: "buttons" }, button("Suggest", suggest), add, clear),
  );
  on(["settings"], draw);
}

async function suggest() {
  const found = await attempt(() => request("GET", "sensor/mask/suggestion"), "No mask can be suggested yet");
  if (!found) return;
  if (found.mask.length) change(found.mask);
  else toast("Nothing near stays in its place while the rest moves, so no mask is needed.", { title: "No body is seen" });
}

function draw() {
  const sectors = mask();
  remake(list, sectors.length, () => sectors.map((_, at) => row(at)));
  for (const input of list.querySelectorAll("input")) if (input !== document.activeElement) input.show();
  add.disabled = sectors.length >= MOST;
  clear.disabled = !sectors.length;
}

/** The numbers of a sector; those that are typed are not overwritten. */
function row(at) {
  const cells = NUMBERS.map((number) => {
    const id = `mask-${at}-${number.key}`;
    return el("div", {}, el("label", { for: id }, number.label), numberInput(id, at, number));
  });
  const remove = iconButton("delete", `Delete sector ${at + 1}`, () => change(mask().toSpliced(at, 1)));
  return el("fieldset", { class: "place" }, el("legend", { class: "visually-hidden" }, `Sector ${at + 1}`), ...cells, remove);
}

function numberInput(id, at, { key, scale, digits, min, max }) {
  const input = el("input", { type: "number", id, min: String(min), max: String(max), step: "any", required: true });
  input.show = () => (input.value = String(Number((mask()[at][key] / scale).toFixed(digits))));
  input.addEventListener("blur", () => mask()[at] && input.show());
  input.addEventListener("change", () => {
    if (input.reportValidity()) change(mask().with(at, { ...mask()[at], [key]: Number(input.value) * scale }));
  });
  return input;
}
