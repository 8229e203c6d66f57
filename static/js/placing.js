// Telling the filter where the sensor is: by dragging in the scene, or in numbers.

import { request } from "./api.js";
import { $, el, setText } from "./dom.js";
import { onSceneMessage, view } from "./scene.js";
import { attempt } from "./actions.js";
import { get, on } from "./store.js";

const HINT = "Press where the sensor is, and drag in the direction it faces";
const DEGREE = Math.PI / 180;

const NUMBERS = [
  { key: "x", label: "x", unit: "m", most: 1e6, of: ({ x }) => fixedNumber(x, 3) },
  { key: "y", label: "y", unit: "m", most: 1e6, of: ({ y }) => fixedNumber(y, 3) },
  {
    key: "heading",
    label: "Heading",
    unit: "°",
    most: 360,
    of: ({ heading }) => fixedNumber(heading / DEGREE, 1),
  },
];

const fixedNumber = (value, digits) => String(Number(value.toFixed(digits)));

const button = el(
  "button",
  { type: "button", id: "set-pose", "aria-pressed": "false", title: HINT, onclick: togglePlacing },
  "Set pose",
);
const inputs = NUMBERS.map(({ key, most }) =>
  el("input", {
    type: "number",
    id: `place-${key}`,
    step: "any",
    required: true,
    min: String(-most),
    max: String(most),
  }),
);
const form = el(
  "form",
  { id: "place", class: "place", hidden: true, onsubmit: submit },
  ...NUMBERS.map(({ label, unit, key }, at) =>
    el("label", { for: `place-${key}` }, `${label}, ${unit}`, inputs[at]),
  ),
  el("button", { class: "button" }, "Set"),
);

let placing = false;

/** The button; pressed, it shows the numbers, too. */
export function placingControls() {
  setText($("place-hint"), HINT);
  onSceneMessage("pose", place);
  on(["settings"], ({ navigation }) => {
    const { mode, method } = navigation;
    button.disabled = mode === "off" || (mode === "slam" && method === "scans");
    if (placing && button.disabled) setPlacing(false);
  });
  return [button, form];
}

/** Begins to wait for a pose, or gives up. */
export function togglePlacing() {
  if (!button.disabled) setPlacing(!placing);
}

/** Gives up. Returns whether a pose was waited for. */
export function cancelPlacing() {
  const was = placing;
  if (was) setPlacing(false);
  return was;
}

function setPlacing(wanted) {
  placing = wanted;
  if (wanted) fill(get("frame")?.localization?.pose ?? { x: 0, y: 0, heading: 0 });
  view()?.setPlacing(wanted);
  button.setAttribute("aria-pressed", String(wanted));
  form.hidden = !wanted;
  $("place-hint").hidden = !wanted;
}

function fill(pose) {
  inputs.forEach((input, at) => (input.value = NUMBERS[at].of(pose)));
}

function submit(event) {
  event.preventDefault();
  const [x, y, heading] = inputs.map(({ value }) => Number(value));
  place({ x, y, heading: heading * DEGREE });
}

async function place({ x, y, heading }) {
  setPlacing(false);
  await attempt(() => request("POST", "pose", { x, y, heading }), "The pose could not be set");
}
