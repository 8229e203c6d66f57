// The recordings that can be played: those in the server's folder, and the one that comes with the program.

import { request } from "./api.js";
import { $, el, iconButton, remake } from "./dom.js";
import { attempt, open } from "./session.js";
import { on, set } from "./store.js";
import { QUESTION_MS, toast } from "./toasts.js";
import { bytes } from "./units.js";

export function mountRecordings() {
  on(["recordings", "source", "recorder"], drawLibrary);
  on(["panel"], (panel) => panel === "sources" && refreshRecordings());
}

export async function refreshRecordings() {
  const listing = await attempt(() => request("GET", "recordings"), "The recordings could not be listed");
  if (listing) set("recordings", listing);
}

function drawLibrary({ folder, recordings }, source, recorder) {
  const playing = source.recording;
  const growing = recorder.state === "recording" ? stem(recorder.name) : null;
  remake($("library-list"), [folder, recordings, playing, growing], () => [
    el("ul", { class: "entries" }, ...recordings.map((recording) => row(recording, playing, growing))),
    el("p", { class: "muted" }, `Files in ${folder}`),
  ]);
}

/** A raw capture beside a recording has its name but for the ending. */
const stem = (name) => name.replace(/\.[^.]*$/, "");

function row({ name, size, builtin = false }, playing, growing) {
  if (stem(name) === growing) return el("li", {}, entryText(name, "is being recorded"));
  const current = name === playing;
  const about = builtin ? `demo, ${bytes(size)}` : bytes(size);
  const button = el(
    "button",
    { type: "button", class: "entry", "data-key": name, onclick: () => open({ kind: "recording", name }) },
    ...entryText(name, about).childNodes,
  );
  if (current) button.setAttribute("aria-current", "true");
  return el("li", {}, button, ...(builtin ? [] : [deleteButton(name, current)]));
}

const entryText = (name, about) => el("p", { class: "entry" }, el("span", {}, name), el("small", {}, about));

function deleteButton(name, disabled) {
  const button = iconButton("delete", `Delete ${name}`, () => confirmDelete(name));
  button.disabled = disabled;
  return button;
}

function confirmDelete(name) {
  const remove = async () => {
    const path = `recordings/${encodeURIComponent(name)}`;
    await attempt(() => request("DELETE", path), "The recording was not deleted");
    await refreshRecordings();
  };
  toast(`${name} will be deleted from the server.`, {
    title: "Delete this recording?",
    action: { label: "Delete", run: remove },
    linger: QUESTION_MS,
  });
}
