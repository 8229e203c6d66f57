// The address keeps the view: recording and position, or that it is live, methods, layers and every parameter that is not the default.
// Opening such an address reproduces the view; what it leaves out is at its default.

import { isExtractionNumber } from "./parameters.js";
import { merge } from "./optimistic.js";
import { open, settings, transport } from "./actions.js";
import { get, on } from "./store.js";

const WRITE_MS = 500;

const LAYERS = "view.layers.";
const LIVE = ["device", "emulator", "simulation"];

/** Settings besides the numbers that a link carries: name in the link -> path, and how it is read. */
const NAMED = {
  fitter: { path: "extraction.fitter", read: String },
  covariance: { path: "extraction.covariance", read: String },
  compare: { path: "view.compare", read: (text) => text === "true" },
  methods: { path: "view.methods", read: (text) => text.split(",").filter(Boolean) },
  colour: { path: "view.colour", read: String },
  scale: { path: "view.ellipse_scale", read: Number },
  mode: { path: "navigation.mode", read: String },
  method: { path: "navigation.method", read: String },
  landmarks: { path: "navigation.landmarks", read: String },
  motion: { path: "navigation.motion", read: String },
  clusters: { path: "clusters.method", read: String },
  rotate: { path: "view.rotate", read: (text) => text === "true" },
  repeatability: { path: "repeatability.running", read: (text) => text === "true" },
  window: { path: "repeatability.window", read: Number },
};

const at = (object, path) => path.split(".").reduce((node, key) => node?.[key], object);
const nest = (path, value) => path.split(".").reduceRight((inner, key) => ({ [key]: inner }), value);

/** The fields a link carries, each with its name in the link and its reader. */
function carried(fields) {
  const byPath = new Map(fields.map((field) => [field.path, field]));
  const named = Object.entries(NAMED).map(([name, { path, read }]) => ({
    name,
    path,
    read,
    preset: byPath.get(path)?.default,
  }));
  const numbers = fields
    .filter(isExtractionNumber)
    .map(({ key, path, default: preset }) => ({ name: key, path, read: Number, preset }));
  return [...named, ...numbers];
}

const layersOf = (fields) => fields.filter(({ path }) => path.startsWith(LAYERS));

/** Six digits tell any setting; more are what conversions left over. */
const rounded = (value) => (typeof value === "number" ? Number(value.toPrecision(6)) : value);

/** The hash for a state of the page, without "#". */
function encode(source, settings, fields) {
  const link = new URLSearchParams();
  if (source.kind === "recording") {
    link.set("recording", source.recording);
    if (source.topic && source.topics?.length > 1) link.set("topic", source.topic);
    link.set("index", source.index);
  } else link.set("live", source.kind);
  for (const { name, path, preset } of carried(fields)) {
    const value = at(settings, path);
    if (String(rounded(value)) !== String(preset)) link.set(name, rounded(value));
  }
  const layers = layersOf(fields);
  const shown = layers.filter(({ path }) => at(settings, path)).map(({ key }) => key);
  const preset = layers.filter((field) => field.default).map(({ key }) => key);
  if (shown.join() !== preset.join()) link.set("layers", shown);
  return link.toString().replaceAll("%2C", ",").replaceAll("%2F", "/");
}

/** The source and the settings a hash asks for; null if it asks for none. */
function decode(hash, fields) {
  const link = new URLSearchParams(hash.replace(/^#/, ""));
  if (!link.has("recording") && !link.has("live")) return null;
  const changes = carried(fields).map(({ name, path, read, preset }) =>
    nest(path, link.has(name) ? read(link.get(name)) : preset),
  );
  const shown = link.get("layers")?.split(",");
  const layers = layersOf(fields).map((field) =>
    nest(field.path, shown ? shown.includes(field.key) : field.default),
  );
  return { source: sourceOf(link), settings: [...changes, ...layers].reduce(merge, {}) };
}

function sourceOf(link) {
  const live = link.get("live");
  if (!link.has("recording")) return { kind: LIVE.includes(live) ? live : "emulator" };
  const source = {
    kind: "recording",
    name: link.get("recording"),
    index: Number(link.get("index") ?? 0),
    paused: true,
  };
  return link.has("topic") ? { ...source, topic: link.get("topic") } : source;
}

/** Reproduces the view of the address; from then on keeps the address up to date. */
export async function mountLink() {
  await follow({ reloaded: performance.getEntriesByType("navigation")[0]?.type === "reload" });
  window.addEventListener("hashchange", () => follow({ reloaded: false }));
  on(["source", "settings", "frame"], schedule);
}

/** A reload does not rewind what the server plays meanwhile. */
async function follow({ reloaded }) {
  const wanted = decode(location.hash, get("fields"));
  if (!wanted || (reloaded && isOpen(wanted.source))) return;
  if (isOpen(wanted.source)) {
    if (wanted.source.paused) await transport.patch({ state: "paused", index: wanted.source.index });
  } else await open(wanted.source);
  await settings.patch(wanted.settings); // last: a source that is opened brings along the noise of its sensor
}

/** A live view is whatever is live now: nobody's lidar is taken away by an address. */
function isOpen({ kind, name, topic = null }) {
  const source = get("source");
  if (kind !== "recording") return source.live;
  return source.recording === name && (topic === null || source.topic === topic);
}

let timer = 0;

function schedule() {
  timer ||= setTimeout(write, WRITE_MS);
}

function write() {
  timer = 0;
  const { kind, index } = get("frame").source;
  const source = get("source");
  const current = kind === source.kind ? { ...source, index } : source;
  const hash = `#${encode(current, get("settings"), get("fields"))}`;
  if (hash !== location.hash) history.replaceState(null, "", hash);
}
