// The recordings that can be played: those in the server's folder, and the ones that come with the program. Each is
// played, downloaded, renamed or deleted here; what was deleted can be taken back for a while.

import { address, request } from "./api.js";
import { $, el, icon, iconButton, remake } from "./dom.js";
import { attempt, open } from "./actions.js";
import { get, on, set } from "./store.js";
import { toast } from "./toasts.js";
import { makeMap, makingWords } from "./making.js";
import { renameForm } from "./renaming.js";
import { bytes, duration } from "./units.js";

export function mountRecordings() {
  on(["recordings", "source", "recorder", "recordingFacts", "renaming"], drawLibrary);
  on(["panel"], (panel) => panel === "sources" && refreshRecordings());
  set("recordingFacts", {});
  set("renaming", null);
}

export async function refreshRecordings() {
  const listing = await attempt(() => request("GET", "recordings"), "The recordings could not be listed");
  if (!listing) return;
  set("recordings", listing);
  learn();
}

let learning = false;

/** Asks what each recording holds, one after the other: the server reads them for that. */
async function learn() {
  if (learning) return;
  learning = true;
  for (let recording = unknown(); recording; recording = unknown()) {
    const facts = await request("GET", `${pathOf(recording.name)}/facts`).catch(() => null);
    set("recordingFacts", { ...get("recordingFacts"), [keyOf(recording)]: facts });
  }
  learning = false;
}

/** The next of those listed now that nobody has asked about, while someone looks. */
const unknown = () =>
  get("panel") === "sources" &&
  get("recordings").recordings.find((recording) => !(keyOf(recording) in get("recordingFacts")) && !isGrowing(recording));

const pathOf = (name) => `recordings/${encodeURIComponent(name)}`;
const keyOf = ({ name, size, modified }) => [name, size, modified].join("/");

/** A raw capture beside a recording has its name but for the ending. */
const stem = (name) => name.replace(/\.[^.]*$/, "");

const isGrowing = ({ name }) => {
  const recorder = get("recorder");
  return recorder?.state === "recording" && stem(recorder.name) === stem(name);
};

function drawLibrary({ folder, recordings, unlisted }, source, recorder, known, renaming) {
  const playing = source.recording;
  const growing = recorder.state === "recording" ? recorder.name : null;
  remake($("library-list"), [folder, recordings, unlisted, playing, growing, known, renaming], () => [
    el("ul", { class: "entries" }, ...recordings.map((recording) => row(recording, playing, renaming))),
    ...(unlisted.length ? [el("p", { class: "fault" }, unlistedText(unlisted))] : []),
    el("p", { class: "muted" }, `Files in ${folder}`),
  ]);
}

const NAMED = 3; // of the files that are not listed

function unlistedText(names) {
  const more = names.length > NAMED ? ` and ${names.length - NAMED} more` : "";
  const characters = 'Rename without \\ : * ? " < > | and control characters, a dot or blank at the end, and more than 200 bytes.';
  return `Not listed, since such names do not work on every system: ${names.slice(0, NAMED).join(", ")}${more}. ${characters}`;
}

function row(recording, playing, renaming) {
  const { name, builtin = false } = recording;
  if (isGrowing(recording)) return el("li", {}, entryText(name, "is being recorded"));
  if (name === renaming) return el("li", {}, renameRecording(name));
  const isPlaying = name === playing;
  const button = el(
    "button",
    { type: "button", class: "entry", "data-key": name, onclick: () => open({ kind: "recording", name }) },
    ...entryText(name, extentOf(recording)).childNodes,
  );
  if (isPlaying) button.setAttribute("aria-current", "true");
  const about = el("p", { class: "about muted" }, aboutOf(recording));
  const map = iconButton("map", makingWords(name), () => makeMap(name));
  return el("li", {}, button, map, downloadLink(name), ...(builtin ? [] : changeButtons(name, isPlaying)), about);
}

const entryText = (name, about) => el("p", { class: "entry" }, el("span", {}, name), el("small", {}, about));

/** How long and how large. */
function extentOf(recording) {
  const facts = get("recordingFacts")[keyOf(recording)];
  const parts = [facts?.duration != null && duration(facts.duration), bytes(recording.size)];
  return parts.filter(Boolean).join(", ");
}

/** What took it, as far as the file says so. */
function aboutOf(recording) {
  const facts = get("recordingFacts")[keyOf(recording)];
  const sensor = facts?.format && (facts.sensor ?? "sensor not named");
  const parts = [recording.builtin && "demo", sensor, facts?.format, facts?.topics.join(", "), facts?.problem];
  return parts.filter(Boolean).join(" · ");
}

const downloadLink = (name) =>
  el(
    "a",
    {
      class: "button icon",
      href: address(pathOf(name)).href,
      download: name,
      "aria-label": `Download ${name}`,
      title: `Download ${name}`,
    },
    icon("download"),
  );

function changeButtons(name, isPlaying) {
  const rename = iconButton("rename", `Rename ${name}`, () => set("renaming", name));
  const remove = iconButton("delete", `Delete ${name}`, () => removeRecording(name));
  remove.disabled = isPlaying;
  return [rename, remove];
}

function renameRecording(name) {
  const rename = async (changed) => {
    const done = await attempt(() => request("PATCH", pathOf(name), { name: changed }), "The recording was not renamed");
    if (done) await refreshRecordings();
    return done;
  };
  const end = () => set("renaming", null);
  return renameForm({ value: name, label: `New name of ${name}`, key: name, selected: stem(name).length, required: true, rename, end });
}

async function removeRecording(name) {
  const isGone = await attempt(async () => {
    await request("DELETE", pathOf(name));
    return true;
  }, "The recording was not deleted");
  await refreshRecordings();
  if (!isGone) return;
  const restore = async () => {
    await attempt(() => request("POST", `${pathOf(name)}/restore`), "The recording could not be restored");
    await refreshRecordings();
  };
  toast(name, {
    title: "The recording is deleted",
    action: { label: "Undo", run: restore },
    linger: 1e3 * get("recordings").undo_within,
  });
}
