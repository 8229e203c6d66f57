// What plays: the switch between device, emulator, simulation and recording, and what is known of the source.

import { $, el, remake, setText } from "./dom.js";
import { KINDS, nameOf, stateOf, stateText } from "./live.js";
import { refreshRecordings } from "./recordings.js";
import { open } from "./actions.js";
import { simulate } from "./simulation.js";
import { get, on } from "./store.js";
import { toast } from "./toasts.js";

const OPENING = {
  device: ({ port }) => `Connecting to ${port ?? "the device"}`,
  emulator: () => "Starting the emulator",
  simulation: () => "Starting the simulation",
  recording: ({ name }) => `Opening ${name}`,
};

const ENDED = {
  device: "The device was disconnected",
  emulator: "The emulator has ended",
  simulation: "The simulation has ended",
  recording: "The recording could not be read to its end",
};

let lastRecording = null;
let told = null;

export function mountSource() {
  $("kinds").append(...Object.keys(KINDS).map(kindButton));
  on(["source", "opening", "connection"], drawSwitch);
  on(["source"], drawFacts);
  on(["source"], ({ recording }) => (lastRecording = recording ?? lastRecording));
  on(["source"], tell);
}

function kindButton(kind) {
  return el("button", { type: "button", "data-kind": kind, onclick: () => choose(kind) }, KINDS[kind]);
}

/** Opens the only device, an emulator, a simulation as it is set, or the recording that played last. */
async function choose(kind) {
  const source = get("source");
  if (kind === source.kind && !source.error) return;
  if (kind === "recording") await openRecording();
  else if (kind === "simulation") await simulate();
  else await open({ kind });
}

async function openRecording() {
  await refreshRecordings();
  const names = get("recordings")?.recordings.map(({ name }) => name) ?? [];
  const name = names.includes(lastRecording) ? lastRecording : names[0];
  if (name) await open({ kind: "recording", name });
  else toast("Record something, or upload a file.", { title: "There is no recording yet" });
}

function drawSwitch(source, opening, connection) {
  for (const button of $("kinds").children) {
    const { kind } = button.dataset;
    button.setAttribute("aria-pressed", String(kind === source.kind));
    button.setAttribute("aria-busy", String(kind === opening?.kind));
  }
  $("source-state").dataset.state = opening ? "connecting" : stateOf(source, connection);
  setText($("source-state"), opening ? OPENING[opening.kind](opening) : stateText(source, connection));
}

function drawFacts(source) {
  const { recording, format, topic, topics, notes } = source;
  const error = source.device?.error ?? source.error;
  const shown = [nameOf(source), recording, format, topic, topics, notes, error];
  remake($("source-facts"), shown, () => [
    el("p", {}, [nameOf(source), format, topic].filter(Boolean).join(" · ")),
    ...(error ? [el("p", { class: "fault", role: "alert" }, error)] : []),
    ...(notes.length ? [el("ul", { class: "notes" }, ...notes.map((note) => el("li", {}, note)))] : []),
    ...topicRows(source),
  ]);
}

function topicRows({ recording, topic, topics }) {
  if (!(topics?.length > 1)) return [];
  const list = el(
    "select",
    { id: "topic", "data-key": "topic" },
    ...topics.map((name) => el("option", { value: name, selected: name === topic }, name)),
  );
  list.addEventListener("change", () => open({ kind: "recording", name: recording, topic: list.value }));
  return [el("div", { class: "row" }, el("label", { for: "topic" }, "Lidar topic"), list)];
}

/** What ends a source is told once, wherever the user looks. */
function tell({ error, kind }) {
  if (error && error !== told) toast(error, { title: ENDED[kind], kind: "error", about: "source" });
  told = error;
}
