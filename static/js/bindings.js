// Controls tied to settings: each shows the state's value, and sends what the user enters. What they are tied to is
// a model {key, value(path), change(path, value)}: the server's settings, or a draft that is sent as a whole.

import { el } from "./dom.js";
import { changeSetting, setting } from "./actions.js";
import { on } from "./store.js";

const same = (value) => value;

const SETTINGS = { key: "settings", value: setting, change: changeSetting };

/** Ties a control to the setting at a dotted path; `show` and `read` convert to and from the control's value. */
export function bind(control, path, { show = same, read = same, model = SETTINGS } = {}) {
  const property = control.type === "checkbox" ? "checked" : "value";
  const refresh = () => {
    const value = model.value(path);
    if (value !== undefined && !held(control)) control[property] = show(value);
  };
  control.addEventListener(control.type === "range" ? "input" : "change", () => {
    if (control.reportValidity()) model.change(path, read(control[property]));
  });
  control.addEventListener("blur", refresh);
  on([model.key], refresh);
  return control;
}

/** Whether the user has hold of the control: what he drags or types is not overwritten. */
function held(control) {
  if (control.type === "range") return control.matches(":active");
  return control.type === "number" && control === document.activeElement;
}

export function switchRow(label, path, hint = "") {
  const box = bind(el("input", { type: "checkbox", role: "switch" }), path);
  return el("label", { class: "row switch", title: hint }, el("span", {}, label), box);
}

/** A select with a label; options are [value, text] pairs. */
export function selectRow(label, path, options, model) {
  const list = el(
    "select",
    { id: idOf(path) },
    ...options.map(([value, text]) => el("option", { value }, text)),
  );
  return el("div", { class: "row" }, el("label", { for: list.id }, label), bind(list, path, { model }));
}

/** One of a few, side by side: `choices` are [value, text] pairs; further attributes go to the group. */
export function segmentedRow(label, path, choices, attributes = {}) {
  const settled = { value: () => setting(path), change: (value) => changeSetting(path, value) };
  return choiceRow(label, idOf(path), choices, settled, attributes);
}

/** The same of what several settings say together: `value()` tells it, `change(value)` sets it. */
export function choiceRow(label, name, choices, { value: chosen, change }, attributes = {}) {
  const radios = choices.map(([value, text]) => {
    const radio = el("input", { type: "radio", name, value, class: "visually-hidden" });
    radio.addEventListener("change", () => change(value));
    on(["settings"], () => (radio.checked = chosen() === value));
    return el("label", {}, radio, el("span", {}, text));
  });
  const group = el("fieldset", { class: "row segmented", ...attributes });
  group.append(el("legend", {}, label), el("span", { class: "segments" }, ...radios));
  return group;
}

/** A small toggle, several of which stand in a line. */
export function chip(label, path, hint = "") {
  const box = bind(el("input", { type: "checkbox", id: idOf(path), class: "visually-hidden" }), path);
  return el("label", { class: "chip", title: hint }, box, el("span", {}, label));
}

export const idOf = (path) => `setting-${path.replaceAll(".", "-")}`;
