// Controls tied to settings: each shows the state's value, and sends what the user enters.

import { el } from "./dom.js";
import { changeSetting, setting } from "./session.js";
import { on } from "./store.js";

const same = (value) => value;

/** Ties a control to the setting at a dotted path; `show` and `read` convert to and from the control's value. */
export function bind(control, path, { show = same, read = same } = {}) {
  const property = control.type === "checkbox" ? "checked" : "value";
  const refresh = () => {
    const value = setting(path);
    if (value !== undefined && !held(control)) control[property] = show(value);
  };
  control.addEventListener(control.type === "range" ? "input" : "change", () => {
    if (control.reportValidity()) changeSetting(path, read(control[property]));
  });
  control.addEventListener("blur", refresh);
  on(["settings"], refresh);
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
export function selectRow(label, path, options) {
  const list = el(
    "select",
    { id: idOf(path) },
    ...options.map(([value, text]) => el("option", { value }, text)),
  );
  return el("div", { class: "row" }, el("label", { for: list.id }, label), bind(list, path));
}

/** A small toggle, several of which stand in a line. */
export function chip(label, path, hint = "") {
  const box = bind(el("input", { type: "checkbox", class: "visually-hidden" }), path);
  return el("label", { class: "chip", title: hint }, box, el("span", {}, label));
}

export const idOf = (path) => `setting-${path.replaceAll(".", "-")}`;
