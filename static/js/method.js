// Which fitter, which covariance, and which methods are compared.

import { bind, idOf, segmentedRow, switchRow } from "./bindings.js";
import { $, el, setText, swatch } from "./dom.js";
import { changeSetting, setting } from "./actions.js";
import { get, on } from "./store.js";
import { capital } from "./units.js";

const COVARIANCES = {
  consistent: "From how the noise of every beam moves the fit: the ellipses are true as long as the noise below is.",
  published: "As printed in the method's paper. For CWLF and WCTLS its ellipses are too small.",
};

export function mountMethod() {
  on(["methods"], (methods) => {
    $("method").replaceChildren(
      $("method").querySelector("h2"),
      ...fitterRows(methods),
      ...covarianceRows(),
      compareRows(methods),
    );
  });
  on(["methods", "settings"], describe);
}

function fitterRows(methods) {
  const options = methods.map(({ name, title }) => el("option", { value: name }, title));
  const list = bind(
    el("select", { id: idOf("extraction.fitter"), "aria-describedby": "fitter-about" }, ...options),
    "extraction.fitter",
  );
  const label = el("label", { for: list.id }, "Fitter");
  return [el("div", { class: "row" }, label, list), el("p", { class: "muted about", id: "fitter-about" })];
}

function covarianceRows() {
  const choices = Object.keys(COVARIANCES).map((kind) => [kind, capital(kind)]);
  return [
    segmentedRow("Covariance", "extraction.covariance", choices, { "aria-describedby": "covariance-about" }),
    el("p", { class: "muted about", id: "covariance-about" }),
  ];
}

function compareRows(methods) {
  const boxes = methods.map(({ name, title }) => {
    const box = el("input", { type: "checkbox", "data-method": name });
    box.addEventListener("change", () => toggleMethod(name));
    on(["settings"], () => (box.checked = setting("view.methods").includes(name)));
    return el("label", { class: "method" }, box, swatch(name), el("span", {}, title));
  });
  const group = el("fieldset", { id: "compared", class: "compared" });
  group.append(el("legend", { class: "visually-hidden" }, "Methods to compare"), ...boxes);
  return el(
    "div",
    {},
    switchRow("Compare methods", "view.compare", "Several fitters on the same segmentation"),
    group,
  );
}

/** Adds or takes away a method of the comparison, in the registry's order. */
export function toggleMethod(name) {
  const shown = setting("view.methods");
  const wanted = shown.includes(name) ? shown.filter((other) => other !== name) : [...shown, name];
  const order = get("methods").map((method) => method.name);
  return changeSetting(
    "view.methods",
    order.filter((other) => wanted.includes(other)),
  );
}

function describe(methods, settings) {
  const { fitter, covariance } = settings.extraction;
  const chosen = methods.find(({ name }) => name === fitter);
  const about = $("fitter-about");
  setText(about, chosen ? `${chosen.summary} Source: ${chosen.reference}.` : "");
  setText($("covariance-about"), COVARIANCES[covariance] ?? "");
  $("compared").hidden = !settings.view.compare;
}
