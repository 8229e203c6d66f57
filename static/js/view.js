// What the scene shows: layers, colours, the size of the ellipses, and the legend that says so.

import { chip, idOf, selectRow, switchRow } from "./bindings.js";
import { settings } from "./actions.js";
import { $, el, remake } from "./dom.js";
import { stroke } from "./figure.js";
import { parameterRow } from "./parameters.js";
import { LANDMARK_SIGMAS } from "./overlay/marks.js";
import { TOOLS } from "./overlay/tools.js";
import { ownChoices } from "./own.js";
import { isOfScans, isPlaced } from "./pose.js";
import { get, on } from "./store.js";
import { shape } from "./svg.js";
import { fixed } from "./units.js";

/** Layers of the map, with what a map has to be of to have them. */
const OF_MAP = { pose: "", trail: "", dead_reckoned: "", truth: "", occupancy: "grid", walls: "scans", landmarks: "landmarks", associations: "landmarks" };

/** What layers are called here and in the legend, where their key would not say it. */
const NAMES = {
  segments: "Walls", pose: "Position", trail: "Estimated path", dead_reckoned: "Odometry path", truth: "True path",
  walls: "Walls of the map", associations: "Matches",
};

const narrow = matchMedia("(max-width: 1199px)"); // where the room needs the place

const FADES = [[0, "None"], [5, "The last 5"], [20, "The last 20"], [50, "The last 50"]];
const COLOURS = { plain: "Plain", segment: "By wall", quality: "By quality", range: "By range" };

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
      selectRow("Fading scans", "fade", FADES, TOOLS),
      resetRow(),
    );
    $("rejection-toggle").replaceChildren(switchRow("Show them in the scene", "view.layers.rejected"));
  });
  foldLegend();
  narrow.addEventListener("change", foldLegend);
  for (const key of ["frame", "settings", "methods", "sizes", "localization"]) on([key], refreshLegend);
  on(["frame"], hideUnknownPaths);
}

/** Paths that nothing tells of, where a recording has no odometry or no truth, have no toggle. */
function hideUnknownPaths({ localization: now }) {
  for (const { layer, isKnown } of PATHS.filter(({ isOfSome }) => isOfSome)) {
    const toggle = $(idOf(`view.layers.${layer}`))?.closest(".chip");
    if (toggle) toggle.hidden = Boolean(now) && !isKnown(now);
  }
}

const foldLegend = () => ($("legend").open = !narrow.matches);

function refreshLegend() {
  const [frame, settings, methods] = ["frame", "settings", "methods"].map(get);
  if (frame && settings && methods) drawLegend(frame, settings, methods, get("sizes"), get("localization"));
}

/** Layers, theme, rotation and the size of ellipses are this browser's own. */
function resetRow() {
  const button = el("button", { type: "button", class: "button", onclick: settings.forgetOwn }, "Reset the view");
  on(["settings"], () => (button.disabled = ownChoices().length === 0));
  return el("div", { class: "buttons" }, button);
}

/** Toggles for the layers of the scene: those of a scan, or those of the map. */
export function layerChips(fields, { ofMap }) {
  const layers = fields.filter(({ path, key }) => path.startsWith("view.layers.") && key in OF_MAP === ofMap);
  const chips = layers.map(({ path, key, label, description }) => {
    const node = chip(NAMES[key] ?? label, path, description);
    node.dataset.of = OF_MAP[key] ?? "";
    return node;
  });
  const group = el("fieldset", { class: "chips" });
  group.append(el("legend", { class: "visually-hidden" }, "Layers"), ...chips);
  return group;
}

/** What is drawn of a scan besides walls and corners: layer -> sign. */
const OF_SCAN = [
  { layer: "corners", sign: "corner-sign", label: "Corner" },
  { layer: "points", sign: "point-sign", label: "Point", isKnown: ({ colour_scale: scale }) => !scale },
  { layer: "sensor", sign: "sensor-sign", label: "Sensor" },
  { layer: "sensor", sign: "mask-sign", label: "Masked", isKnown: (_, { sensor }) => sensor.mask?.length },
  { layer: "rejected", sign: "rejected-sign", label: "Rejected" },
  { layer: "clusters", sign: "cluster-sign", label: "Cluster, 2σ" },
  { layer: "gaps", sign: "gap-sign", label: "Gap, data lost", isKnown: ({ gaps }) => gaps.length },
];

/** Where the sensor is and was, as the scene may show it: layer -> sign, whether it is known, and whether only some sources tell it. */
const PATHS = [
  { layer: "pose", sign: "pose-sign", label: "Position, 95\u2009%", isKnown: isPlaced },
  { layer: "trail", sign: "trail", label: NAMES.trail, isKnown: () => true },
  {
    layer: "dead_reckoned",
    sign: "reckoned",
    label: NAMES.dead_reckoned,
    isKnown: ({ dead_reckoned: way }) => way,
    isOfSome: true,
  },
  { layer: "truth", sign: "true", label: NAMES.truth, isKnown: ({ truth }) => truth, isOfSome: true },
];

/** What is drawn of the map: layer -> signs. */
const MAPPED = [
  { layer: "walls", sign: "mapped-wall", label: "Wall of the map" },
  { layer: "landmarks", sign: "landmark", label: `Landmark, ${LANDMARK_SIGMAS}\u2009σ` },
  { layer: "landmarks", sign: "tentative", label: "Tentative" },
  { layer: "associations", sign: "association", label: NAMES.associations },
];

const SIZES = {
  grown: "too small to see: drawn larger. Zoom in for true sizes",
  shrunk: "larger than the view: drawn smaller",
};

/** The legend names what is drawn, and says by how much the ellipses are enlarged and what the colours of points mean. */
function drawLegend(frame, settings, methods, sizes, localization) {
  const { ellipse_scale: scale, layers } = settings.view;
  const { localization: now, colour_scale: colours } = frame;
  const paths = PATHS.filter(({ layer, isKnown }) => now && layers[layer] && isKnown(now));
  const ofScans = isOfScans(settings.navigation, localization);
  const ofWalls = ofScans && (settings.navigation.mode === "slam" || get("mapped").walls.length > 0);
  const mapped = MAPPED.filter(({ layer }) => now && layers[layer] && (layer === "walls" ? ofWalls : !ofScans));
  const ofScan = OF_SCAN.filter(({ layer, isKnown }) => layers[layer] && (isKnown?.(frame, settings) ?? true));
  const signs = [...ofScan, ...paths, ...mapped];
  const notes = layers.ellipses ? ellipseNotes(frame, scale, sizes) : ["Ellipses hidden"];
  const shown = [frame.methods, signs, notes, colours, document.documentElement.dataset.theme];
  remake($("legend-body"), shown, () => {
    const titles = new Map(methods.map(({ name, title, dash }) => [name, { title, dash }]));
    const entries = [
      ...frame.methods.map((name) => methodEntry(name, titles.get(name), frame.methods.length > 1)),
      ...signs.map(({ sign, label }) => el("li", {}, stroke(sign), label)),
    ];
    return [
      el("ul", {}, ...entries),
      ...(colours ? [scaleOf(colours)] : []),
      ...notes.map((note) => el("p", {}, note)),
    ];
  });
}

/** A method with a piece of its outline: colour and dash; a single one has made all walls, and need not be named. */
function methodEntry(name, { title, dash }, isCompared) {
  const outline = shape("path", { method: name, d: "M0 5H22", "stroke-dasharray": dash.join(" ") });
  const sign = shape("svg", { class: "outline-sign", viewBox: "0 0 22 10", "aria-hidden": "true" }, outline);
  return el("li", { class: "method-name" }, sign, isCompared ? title : "Wall");
}

function ellipseNotes({ methods, covariance }, scale, sizes) {
  const enlarged = `Ellipses of corners: ${fixed(scale, Number.isInteger(scale) ? 0 : 1)}\u2009σ, ${covariance}`;
  const apart = methods.length > 1 ? ["Outlines that would coincide lie 3 px apart"] : [];
  const resized = Object.entries(SIZES)
    .filter(([size]) => sizes?.[size])
    .map(([size, words]) => `${sizes[size]} ${words}`);
  return [enlarged, ...apart, ...resized];
}

/** Colours that mean a number, with the numbers at their ends. */
function scaleOf({ high, unit, stops }) {
  const ramp = el("span", { class: "ramp", "aria-hidden": "true" });
  ramp.style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
  const label = unit ? "Range" : "Quality";
  return el("p", { class: "colour-scale" }, label, el("span", {}, "0"), ramp, el("span", {}, `${fixed(high, 0)}\u2009${unit}`));
}
