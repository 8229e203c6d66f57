// What the scene shows: layers, colours, the size of the ellipses, and the legend that says so.

import { chip, selectRow, switchRow } from "./bindings.js";
import { $, el, remake, swatch } from "./dom.js";
import { stroke } from "./figure.js";
import { parameterRow } from "./parameters.js";
import { on } from "./store.js";
import { fixed } from "./units.js";

const OF_MAP = ["pose", "trail", "dead_reckoned", "truth", "landmarks", "associations"];

const COLOURS = { plain: "Plain", segment: "By segment", quality: "By quality", range: "By range" };

export function mountView() {
  on(["fields"], (fields) => {
    const colour = fields.find(({ path }) => path === "view.colour");
    const scale = fields.find(({ path }) => path === "view.ellipse_scale");
    const options = colour.options.map((value) => [value, COLOURS[value] ?? value]);
    $("view").replaceChildren(
      $("view").querySelector("h2"),
      layerChips(fields, { ofMap: false }),
      selectRow("Point colour", "view.colour", options),
      parameterRow({ ...scale, label: "Ellipse scale", unit: "× σ" }),
    );
    $("rejection-toggle").replaceChildren(switchRow("Show them in the scene", "view.layers.rejected"));
  });
  on(["frame", "settings", "methods"], drawLegend);
}

/** Toggles for the layers of the scene: those of a scan, or those of the map. */
export function layerChips(fields, { ofMap }) {
  const layers = fields.filter(
    ({ path, key }) => path.startsWith("view.layers.") && OF_MAP.includes(key) === ofMap,
  );
  const chips = layers.map(({ path, label, description }) => chip(label, path, description));
  const group = el("fieldset", { class: "chips" });
  group.append(el("legend", { class: "visually-hidden" }, "Layers"), ...chips);
  return group;
}

/** The ways of the sensor that the scene may show: layer -> sign, and whether it is known. */
const PATHS = [
  { layer: "trail", sign: "trail", label: "Estimated way", isKnown: () => true },
  {
    layer: "dead_reckoned",
    sign: "reckoned",
    label: "By odometry alone",
    isKnown: ({ dead_reckoned: way }) => way,
  },
  { layer: "truth", sign: "true", label: "True way", isKnown: ({ truth }) => truth },
];

/** What is drawn of the map: layer -> signs. */
const MAPPED = [
  { layer: "landmarks", sign: "landmark", label: "Landmark" },
  { layer: "landmarks", sign: "tentative", label: "Tentative" },
  { layer: "associations", sign: "association", label: "Match" },
];

/** The legend names the methods and ways in the frame and states by how much the ellipses are enlarged. */
function drawLegend(frame, settings, methods) {
  const { ellipse_scale: scale, layers } = settings.view;
  const { localization: now } = frame;
  const paths = PATHS.filter(({ layer, isKnown }) => now && layers[layer] && isKnown(now));
  const mapped = MAPPED.filter(({ layer }) => now && layers[layer]);
  const ellipses = `Ellipses 1σ × ${fixed(scale, Number.isInteger(scale) ? 0 : 1)}, ${frame.covariance}`;
  const shown = [frame.methods, paths, mapped, layers.ellipses];
  remake($("legend"), [...shown, ellipses], () => {
    const titles = new Map(methods.map(({ name, title }) => [name, title]));
    const entries = [
      ...frame.methods.map((name) => el("li", { class: "method-name" }, swatch(name), titles.get(name) ?? name)),
      ...[...paths, ...mapped].map(({ sign, label }) => el("li", {}, stroke(sign), label)),
    ];
    return [el("ul", {}, ...entries), el("p", {}, layers.ellipses ? ellipses : "Ellipses hidden")];
  });
}
