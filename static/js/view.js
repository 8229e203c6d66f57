// What the scene shows: layers, colours, the size of the ellipses, and the legend that says so.

import { chip, selectRow, switchRow } from "./bindings.js";
import { $, el, setText, swatch } from "./dom.js";
import { parameterRow } from "./parameters.js";
import { on } from "./store.js";
import { fixed } from "./units.js";

const LAYER_HINTS = { rejected: "Candidates that became neither segment nor corner" };

const COLOURS = { plain: "Plain", segment: "By segment", quality: "By quality", range: "By range" };

export function mountView() {
  on(["fields"], (fields) => {
    const layers = fields.filter(({ path }) => path.startsWith("view.layers."));
    const colour = fields.find(({ path }) => path === "view.colour");
    const scale = fields.find(({ path }) => path === "view.ellipse_scale");
    const options = colour.options.map((value) => [value, COLOURS[value] ?? value]);
    $("view").replaceChildren(
      $("view").querySelector("h2"),
      layerChips(layers),
      selectRow("Point colour", "view.colour", options),
      parameterRow({ ...scale, label: "Ellipse scale", unit: "× σ" }),
    );
    $("rejection-toggle").replaceChildren(switchRow("Show them in the scene", "view.layers.rejected"));
  });
  on(["frame", "settings", "methods"], drawLegend);
}

function layerChips(fields) {
  const chips = fields.map(({ path, key, label }) => chip(label, path, LAYER_HINTS[key]));
  const group = el("fieldset", { class: "chips" });
  group.append(el("legend", { class: "visually-hidden" }, "Layers"), ...chips);
  return group;
}

let shown = "";

/** The legend names the methods in the frame and states by how much the ellipses are enlarged. */
function drawLegend(frame, settings, methods) {
  const key = frame.methods.join();
  if (key !== shown) {
    shown = key;
    const titles = new Map(methods.map(({ name, title }) => [name, title]));
    const entries = frame.methods.map((name) => el("li", {}, swatch(name), titles.get(name) ?? name));
    $("legend").replaceChildren(el("ul", {}, ...entries), el("p", {}));
  }
  const { ellipse_scale: scale, layers } = settings.view;
  const ellipses = `Ellipses 1σ × ${fixed(scale, Number.isInteger(scale) ? 0 : 1)}, ${frame.covariance}`;
  setText($("legend").lastChild, layers.ellipses ? ellipses : "Ellipses hidden");
}
