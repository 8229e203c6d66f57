// The maps there are, one for each session: localized in, saved, loaded from a file, named and deleted here.

import { address, request, send } from "./api.js";
import { $, el, icon, iconButton, remake } from "./dom.js";
import { reloadLandmarks } from "./landmarks.js";
import { attempt, changeSetting } from "./actions.js";
import { renameForm } from "./renaming.js";
import { get, on, set } from "./store.js";
import { ask, clearToasts, isToldOf, toast } from "./toasts.js";
import { isOfScans } from "./pose.js";
import { moment, wholeNumber } from "./units.js";
import { zipped } from "./zip.js";

const BUILDING = { zip: "ROS map, walls and plan", png: "Picture" };
const FORMATS = { json: "JSON", csv: "CSV", geojson: "GeoJSON", png: "Picture", zip: "ROS map" };
const OF_GRID = { zip: "ROS map", png: "Picture" };
const OF_WALLS = { ...BUILDING, svg: "Plan, SVG", dxf: "Plan, DXF" };
const BY_SERVER = ""; // what a file is saved as: the server names it after its map
const LOADED = ["json", "csv", "geojson", "zip"];
const MAX_NAME = 200; // characters
const KEY = "map-";
const OF_ROS = ["yaml", "yml", "pgm", "png", "bmp"]; // which come together

const clearButton = el(
  "button",
  { type: "button", disabled: true, onclick: () => confirmClear(get("localization").session) },
  "Clear",
);

export function mountMaps() {
  const picker = el("input", {
    type: "file",
    class: "visually-hidden",
    id: "map-file",
    multiple: true,
    accept: [...LOADED, ...OF_ROS].map((ending) => `.${ending}`).join(),
    "aria-label": "Map to load",
  });
  picker.addEventListener("change", () => {
    load([...picker.files]);
    picker.value = "";
  });
  $("maps").append(
    el("div", { id: "map-list" }),
    el("div", { class: "buttons", id: "map-save" }),
    el(
      "div",
      { class: "buttons" },
      picker,
      el("label", { class: "button", for: picker.id }, icon("upload"), "Load a file"),
      clearButton,
    ),
  );
  on(["panel", "localization", "mapped", "sessionsRevision"], refresh);
  on(["maps", "localization", "landmarks", "renamingMap"], draw);
  set("renamingMap", null);
  on(["localization", "settings", "maps"], offer);
}

let listed = ""; // when the maps were asked for: with which panel open, which map in use, how many walls in one that grows, and which list of sessions

/** Asks while the list is seen, or the name of one of them: in a message, or where maps are made. */
function refresh(panel, { session, mode }, { walls }, revision) {
  const wanted = [panel, session, mode, walls.length, revision].join(" ");
  const isNamed = isToldOf(KEY) || (panel === "sources" && withId(get("making")?.session));
  if ((panel === "map" || isNamed) && listed !== wanted) listMaps();
  listed = wanted;
}

/** A map in a sentence: its name, where it has one, and its number. */
const called = ({ id, name }) => (name ? `${name} (map ${id})` : `map ${id}`);

/** The same as a sentence begins: names stay as they are. */
const begun = (map) => (map.name ? called(map) : `Map ${map.id}`);

const withId = (id) => get("maps")?.sessions.find((session) => session.id === id);

/** The same of a map that may be none of those listed. */
const byId = (id) => withId(id) ?? { id };
export const calledById = (id) => called(byId(id));
export const begunById = (id) => begun(byId(id));

let asked = 0;
let answered = 0;

/** Asks which maps there are. */
export async function listMaps() {
  const number = ++asked;
  const maps = await attempt(() => request("GET", "sessions"), "The maps could not be listed");
  if (!maps || number < answered) return; // an answer that was overtaken
  answered = number;
  const before = get("maps")?.sessions ?? [];
  set("maps", maps);
  before.filter(({ id }) => !maps.sessions.some((session) => session.id === id)).forEach(forget);
}

/** Of a map that is gone nothing is asked or offered any more. */
function forget(session) {
  clearToasts(keyOf(session.id));
  if (get("renamingMap") !== session.id) return;
  set("renamingMap", null);
  toast("It was deleted meanwhile, so it has no name to change.", { title: `${begun(session)} is gone` });
}

const NONE = "None yet. SLAM builds one, or load a file: landmarks, or a map of ROS.";
const NOT_KEPT = "None yet. A map is kept once its walls were seen from several places, or its landmarks several times.";

function draw({ sessions, store }, { session, mode }, landmarks, renaming) {
  const built = mode === "slam" ? store.session : undefined; // one whose server was killed has no end either
  const live = { session, landmarks: landmarks.size, built, none: mode === "slam" ? NOT_KEPT : NONE };
  const shown = renaming === null ? [sessions, store.error, live] : renaming; // what is typed stays while a map grows
  remake($("map-list"), shown, () => rows(sessions, store, { ...live, renaming }));
}

/** What is saved and cleared is the map that is built or localized in. */
function offer(localization, { navigation }, { sessions }) {
  const { session } = localization;
  const ofGrid = isOfScans(navigation, localization);
  const isBuilding = ofGrid && navigation.mode === "slam";
  const isNone = !sessions.length;
  const hasWalls = Boolean(sessions.find(({ id }) => id === session)?.walls);
  const formats = hasWalls ? OF_WALLS : ofGrid ? OF_GRID : FORMATS;
  const links = () => (session === null ? [nothingToSave(isNone)] : saveLinks(session, formats));
  remake($("map-save"), [calledById(session), isBuilding, ofGrid, hasWalls, isNone], () => (isBuilding ? buildingLinks() : links()));
  clearButton.disabled = session === null || ofGrid; // of whole scans nothing would be cleared
}

function rows(sessions, { error }, live) {
  return [
    ...(error ? [el("p", { class: "fault", role: "alert" }, error)] : []),
    ...(sessions.length ? [] : [el("p", { class: "muted" }, live.none)]),
    el("ul", { class: "entries" }, ...[...sessions].reverse().map((session) => row(session, live))),
  ];
}

const contentOf = ({ walls, grid, landmarks }) =>
  walls ? `${wholeNumber(walls)} walls` : grid ? "a grid" : `${wholeNumber(landmarks)} landmarks`;

function row(session, live) {
  const { id, name, source, mode, started, landmarks, walls, grid } = session;
  if (id === live.renaming) return el("li", {}, renameMap(session));
  const isBuilt = id === live.built;
  const isUsed = isBuilt || id === live.session;
  const count = isUsed ? Math.max(landmarks, live.landmarks) : landmarks;
  const holds = contentOf({ walls, grid, landmarks: count });
  const button = el(
    "button",
    {
      type: "button",
      class: "entry",
      title: `Localize in ${called(session)}`,
      "data-key": keyOf(id),
      onclick: () => chooseMap(id),
    },
    el("span", {}, name || `Map ${id}`),
    el("small", {}, holds),
  );
  if (isUsed) button.setAttribute("aria-current", "true");
  const about = [name && `Map ${id}`, isBuilt && "being built", source, mode === "import" && "loaded", moment(started)].filter(Boolean).join(", ");
  const lost = grid && !walls ? holds : `${holds} and their history`;
  const rename = iconButton("rename", `Rename ${called(session)}`, () => set("renamingMap", id));
  const remove = iconButton("delete", `Delete ${called(session)}`, () => confirmDelete(id, lost, isUsed));
  return el("li", {}, button, rename, ...(isBuilt ? [] : [remove]), el("p", { class: "about muted" }, about));
}

/** What its row is found by, and messages about it. */
export const keyOf = (id) => `${KEY}${id}`;

function renameMap(session) {
  const { id, name } = session;
  const rename = async (changed) => {
    const done = await attempt(() => request("PATCH", `sessions/${id}`, { name: changed }), "The map was not renamed");
    if (done) await listMaps();
    return done;
  };
  const end = () => set("renamingMap", null);
  const label = `New name of ${called(session)}`;
  return renameForm({ value: name, label, key: keyOf(id), placeholder: `Map ${id}`, maxLength: MAX_NAME, rename, end });
}

const nothingToSave = (isNone) =>
  el("p", { class: "muted" }, isNone ? "There is no map to save or clear." : "Click a map to localize in it: then it can be saved or cleared.");

const buildingLinks = () => [
  el("p", { class: "muted" }, "Save the map as it is now:"),
  ...Object.entries(BUILDING).map(([format, name]) =>
    saveLink(`map/grid?format=${format}`, `map.${format}`, name, "the map of the building"),
  ),
];

const saveLinks = (session, formats) => [
  el("p", { class: "muted" }, `Save ${calledById(session)} as`),
  ...Object.entries(formats).map(([format, name]) =>
    saveLink(`map?format=${format}&session=${session}`, BY_SERVER, name, calledById(session)),
  ),
];

const saveLink = (path, download, name, what) =>
  el(
    "a",
    { class: "button", href: address(path).href, download, "aria-label": `Save ${what} as ${name}` },
    name,
  );

function chooseMap(session) {
  if (get("settings").navigation.mode !== "slam") return localizeIn(session);
  ask("The map that SLAM builds is kept, but cannot be gone on with.", {
    title: `End SLAM, and localize in ${calledById(session)}?`,
    action: { label: "Localize", run: () => localizeIn(session) },
    about: keyOf(session),
  });
}

/** Localizes in the map of a session. */
export async function localizeIn(session) {
  const chosen = await attempt(
    () => request("PUT", "localization/map", { session }),
    "The map could not be chosen",
  );
  if (chosen) await changeSetting("navigation.mode", "localize");
}

function confirmDelete(session, lost, isUsed) {
  const remove = async () => {
    await attempt(() => request("DELETE", `sessions/${session}`), "The map was not deleted");
    await listMaps();
  };
  ask(`This also deletes its ${lost}.${isUsed ? " The sensor will no longer be localized in it." : ""}`, {
    title: `Delete ${calledById(session)}?`,
    action: { label: "Delete", run: remove },
    about: keyOf(session),
  });
}

/** SLAM would bring back what it sees; so it begins with an empty map of its own. */
function confirmClear(session) {
  const clear = async () => {
    if (get("settings").navigation.mode === "slam") await request("POST", "localization/reset");
    await request("DELETE", `landmarks?session=${session}`);
    await Promise.all([listMaps(), reloadLandmarks()]);
  };
  const isBuilt = get("settings").navigation.mode === "slam";
  ask(`This deletes its landmarks and their history.${isBuilt ? " SLAM starts again with an empty map." : ""}`, {
    title: `Clear ${calledById(session)}?`,
    action: { label: "Clear", run: () => attempt(clear, "The map was not cleared") },
    about: keyOf(session),
  });
}

const ending = (name) => /\.(\w+)$/.exec(name.toLowerCase())?.[1];

/** One file with a map, or a YAML and its image as ROS has them. */
async function load(files) {
  if (!files.length) return;
  const [{ name }] = files;
  const isOfRos = OF_ROS.includes(ending(name));
  const format = isOfRos ? "zip" : LOADED.includes(ending(name)) ? ending(name) : LOADED[0];
  const body = isOfRos ? await zipped(files) : files[0];
  const query = new URLSearchParams({ format, name });
  const loaded = await attempt(() => send("POST", `map?${query}`, { body }), "The map could not be loaded");
  if (!loaded) return;
  await listMaps();
  const action = { label: "Localize in it", run: () => localizeIn(loaded.id) };
  toast(`${name}: ${contentOf(loaded)}`, {
    title: `${begun(loaded)} is loaded`,
    action,
    about: keyOf(loaded.id),
  });
}
