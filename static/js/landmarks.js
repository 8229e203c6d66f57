// The landmarks of the map: asked for when the session changes, then kept up to date by the stream.

import { request } from "./api.js";
import { $, el, setText } from "./dom.js";
import { throttled } from "./throttle.js";
import { longestSigma } from "./pose.js";
import { selectableRows } from "./rows.js";
import { attempt, select, setting } from "./actions.js";
import { get, on, set } from "./store.js";
import { ago, metres, millimetres, wholeNumber } from "./units.js";

const MOST = 500; // in the table
const REDRAW_MS = 500;

const COLUMNS = [
  { key: "kind", label: "Kind", text: ({ kind }) => kind },
  { key: "x", label: "x m", text: ({ x }) => metres(x) },
  { key: "y", label: "y m", text: ({ y }) => metres(y) },
  { key: "sigma", label: "σ mm", text: (landmark) => millimetres(longestSigma(landmark)) },
  { key: "seen", label: "Seen", text: ({ count }) => wholeNumber(count) },
  { key: "age", label: "Ago", text: (landmark) => ago(ageOf(landmark)) },
];

const seen = new Map(); // id -> stamp of the newest frame that it was matched in: the stream tells of it later
let known = new Map(); // id -> landmark
let isPart = false; // there are more than were asked for
let session; // whose landmarks these are
let rows;

export function mountLandmarks() {
  const heads = COLUMNS.map(({ key, label }) => el("th", { scope: "col", class: key }, label));
  $("landmark-table").tHead.append(el("tr", {}, el("th", { scope: "col", class: "name" }, "Id"), ...heads));
  rows = selectableRows($("landmark-table").tBodies[0], {
    name: (id) => `L${id}`,
    cells: () => COLUMNS.map(({ key }) => el("td", { class: key }, "")),
    fill: (cells, landmark) => cells.forEach((cell, at) => setText(cell, COLUMNS[at].text(landmark))),
    choose: (landmark) => select({ landmark }),
  });
  on(["connection"], (connection) => connection === "open" && reloadLandmarks());
  on(["localization"], (localization) => follow(localization.session));
  on(["frame"], noteSeen);
  const fill = throttled(REDRAW_MS, drawTable);
  on(["landmarks"], ({ size }) => setText($("landmark-count"), `${wholeNumber(size)}${isPart ? "+" : ""}`));
  on(["landmarks", "frame", "panel"], (landmarks, _, panel) => panel === "map" && fill(landmarks));
  on(["maps", "landmarks"], (_, landmarks) => fill(landmarks)); // without them there is another note
  on(["selection"], ({ landmark }) => rows.mark(landmark));
}

/** Selects the landmark `by` rows further; the first or last one if none is selected. */
export const nextLandmark = (by) => rows.step(by);

/** Asks for all of them again, after a change that the stream does not tell of. */
export const reloadLandmarks = () => follow(session, { again: true });

/** What has changed in a session's map, as the stream tells. */
export function receiveLandmarks({ session: whose, changed, removed }) {
  if (whose !== session) return;
  for (const landmark of changed) known.set(landmark.id, landmark);
  for (const id of removed) known.delete(id);
  publish();
}

/** How long ago a landmark was seen, in seconds before the scan that is shown. */
function ageOf({ id, last_seen: last }) {
  return (get("frame")?.stamp ?? NaN) - Math.max(last, seen.get(id) ?? -Infinity);
}

const publish = () => set("landmarks", known);

async function follow(wanted, { again = false } = {}) {
  if (wanted === undefined || (wanted === session && !again)) return;
  if (wanted !== session) seen.clear();
  known = new Map();
  isPart = false;
  session = wanted;
  publish();
  if (session !== null) await load(session);
}

async function load(whose) {
  const page = await attempt(
    () => request("GET", `landmarks?session=${whose}&limit=${MOST}`),
    "The landmarks could not be read",
  );
  if (!page || whose !== session) return;
  known = new Map([...page.landmarks.map((landmark) => [landmark.id, landmark]), ...known]);
  isPart = page.next !== null;
  publish();
}

function noteSeen({ stamp, localization }) {
  for (const { landmark } of localization?.innovations ?? []) seen.set(landmark, stamp);
}

function drawTable(landmarks) {
  const sorted = [...landmarks.values()].sort((a, b) => a.id - b.id);
  rows.update(sorted.slice(0, MOST));
  $("landmark-table").hidden = sorted.length === 0;
  setText($("landmark-note"), note(sorted.length));
}

function note(count) {
  if (count > MOST || isPart) return `Only the first ${MOST} are shown; saved files and the API have all of them.`;
  if (count) return "";
  if (session !== null || setting("navigation.mode") === "slam") return "No landmark is confirmed yet.";
  if (get("maps")?.sessions.length) return "No map is localized in. Choose one in Maps, or switch to SLAM to build one.";
  return "There is no map. Switch to SLAM to build one.";
}
