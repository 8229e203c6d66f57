// The recordings in the server's folder, and what is known about the one that plays.

import { request } from "./api.js";
import { $, el, iconButton } from "./dom.js";
import { nameOf } from "./header.js";
import { attempt, open } from "./session.js";
import { on, set } from "./store.js";
import { toast } from "./toasts.js";
import { bytes } from "./units.js";

export function mountRecordings() {
  on(["source"], drawSource);
  on(["source"], ({ error }) => tell(error));
  on(["recordings", "source"], drawLibrary);
  on(["panel"], (panel) => panel === "recordings" && refreshRecordings());
}

let told = null;

/** What goes wrong while a recording plays is told once, wherever the user looks. */
function tell(error) {
  if (error && error !== told) toast(error, { title: "The recording cannot be read on", kind: "error" });
  told = error;
}

export async function refreshRecordings() {
  const listing = await attempt(() => request("GET", "recordings"));
  if (listing) set("recordings", listing);
}

function drawSource(source) {
  const facts = [nameOf(source), source.format, source.topic].filter(Boolean).join(" · ");
  const notes = (source.notes ?? []).map((note) => el("li", {}, note));
  $("source").replaceChildren(
    $("source").querySelector("h2"),
    el("p", {}, facts),
    ...(source.error ? [el("p", { class: "fault", role: "alert" }, source.error)] : []),
    ...(notes.length ? [el("ul", { class: "notes" }, ...notes)] : []),
    ...topicRows(source),
  );
}

function topicRows({ recording, topic, topics }) {
  if (!(topics?.length > 1)) return [];
  const list = el(
    "select",
    { id: "topic" },
    ...topics.map((name) => el("option", { value: name, selected: name === topic }, name)),
  );
  list.addEventListener("change", () => open({ kind: "recording", name: recording, topic: list.value }));
  return [el("div", { class: "row" }, el("label", { for: "topic" }, "Lidar topic"), list)];
}

function drawLibrary({ folder, recordings }, source) {
  const rows = recordings.map((recording) => libraryRow(recording, source));
  const simulated = source.kind === "simulation";
  const simulation = el(
    "li",
    {},
    playButton("Simulated room", "endless", simulated, () => open({ kind: "simulation" })),
  );
  $("library").replaceChildren(
    $("library").querySelector("h2"),
    el("ul", { class: "library" }, simulation, ...rows),
    el("p", { class: "muted" }, `Files in ${folder}`),
  );
}

function libraryRow({ name, size }, source) {
  const current = source.recording === name;
  const remove = iconButton("delete", `Delete ${name}`, () => confirmDelete(name));
  remove.disabled = current;
  return el(
    "li",
    {},
    playButton(name, bytes(size), current, () => open({ kind: "recording", name })),
    remove,
  );
}

function playButton(name, about, current, onclick) {
  const button = el(
    "button",
    { type: "button", class: "recording", onclick },
    el("span", {}, name),
    el("small", {}, about),
  );
  if (current) button.setAttribute("aria-current", "true");
  return button;
}

function confirmDelete(name) {
  const remove = async () => {
    await attempt(() => request("DELETE", `recordings/${encodeURIComponent(name)}`));
    await refreshRecordings();
  };
  toast(`${name} will be deleted from the server.`, {
    title: "Delete this recording?",
    action: { label: "Delete", run: remove },
  });
}
