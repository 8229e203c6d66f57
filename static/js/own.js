// What belongs to this browser alone: theme, layers, size of the ellipses, rotation. The server's view is what a browser
// shows that has chosen nothing; a choice that differs is kept here, until that is set for all over REST.

const KEY = "view";
const OWN = ["theme", "layers", "ellipse_scale", "rotate"];

/** Layers that the server draws: one that it does not draw has to be asked for, and then is there for all to show. */
const DRAWN = ["points", "segments", "rejected", "gaps", "clusters", "trail", "dead_reckoned", "truth", "occupancy", "walls", "associations"];

let own = stored(); // dotted path below the view -> value
let server = null; // the view of the server

function stored() {
  try {
    return new Map(Object.entries(JSON.parse(localStorage.getItem(KEY) ?? "{}")));
  } catch {
    return new Map(); // not ours
  }
}

let kept = ""; // as it is stored: states come often, and are written only if they differ

function keep() {
  const text = JSON.stringify(Object.fromEntries(own));
  if (text !== kept) localStorage.setItem(KEY, text);
  kept = text;
}

const at = (view, path) => path.split(".").reduce((node, key) => node?.[key], view);
const nest = (path, value) => path.split(".").reduceRight((inner, key) => ({ [key]: inner }), value);

/** The settings as this browser shows them. */
export function withOwn(settings) {
  const view = { ...settings.view, layers: { ...settings.view.layers } };
  for (const [path, value] of own) {
    const [head, key] = path.split(".");
    if (key) view[head][key] = value;
    else view[head] = value;
  }
  return { ...settings, view };
}

/** Takes the server's word: what was set there meanwhile overrules what was chosen here. */
export function overrule({ view }) {
  for (const path of own.keys()) {
    if (server && at(server, path) !== at(view, path)) own.delete(path);
  }
  server = view;
  keep();
}

/** Keeps what of a change belongs to this browser; the rest is for the server. */
export function choose({ view = {}, ...change }) {
  const shared = [];
  for (const [path, value] of leaves(view)) {
    const isAsked = value === true && DRAWN.includes(path.split(".")[1]) && !at(server, path);
    if (!OWN.includes(path.split(".")[0]) || isAsked) shared.push([path, value]);
    if (isAsked || value === at(server, path)) own.delete(path);
    else if (OWN.includes(path.split(".")[0])) own.set(path, value);
  }
  keep();
  const rest = shared.map(([path, value]) => nest(path, value));
  return rest.length ? { ...change, view: rest.reduce(joined) } : change;
}

/** Shows what the server says. */
export function forgetOwn() {
  own = new Map();
  keep();
}

/** What is chosen here otherwise than the server has it, as dotted paths below the view. */
export const ownChoices = () => [...own.keys()];

function leaves(node, path = []) {
  if (node === null || typeof node !== "object" || Array.isArray(node)) return [[path.join("."), node]];
  return Object.entries(node).flatMap(([key, child]) => leaves(child, [...path, key]));
}

const joined = (one, other) => ({ ...one, ...other, ...(other.layers && { layers: { ...one.layers, ...other.layers } }) });
