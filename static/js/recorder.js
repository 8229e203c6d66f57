// Recording what plays: one button, always there; the result is offered to be played.

import { request } from "./api.js";
import { $, el, setText } from "./dom.js";
import { refreshRecordings } from "./recordings.js";
import { attempt, open } from "./actions.js";
import { get, on, set } from "./store.js";
import { toast } from "./toasts.js";
import { bytes, clock } from "./units.js";

const button = el("button", { type: "button", class: "button record", onclick: toggleRecording }, "Record");
const raw = el("input", { type: "checkbox", class: "visually-hidden", id: "record-raw" });
const rawChip = el(
  "label",
  { class: "chip", title: "Capture the bytes of the serial line too, in a file of their own" },
  raw,
  el("span", {}, "Raw"),
);
const status = el("p", { id: "recorder-status" });

/** The controls, for the timeline. */
export function recorderControls() {
  on(["recorder", "source"], draw);
  on(["recorder"], tell);
  return el("div", { class: "recorder", role: "group", "aria-label": "Recording" }, status, rawChip, button);
}

let busy = false;

export async function toggleRecording() {
  if (busy) return;
  busy = true;
  const [verb, body] = isRecording() ? ["stop"] : ["start", { raw: raw.checked }];
  const ask = () => request("POST", `recorder/${verb}`, body);
  const answer = await attempt(ask, `The recorder did not ${verb}`);
  busy = false;
  if (answer) set("recorder", answer);
}

const isRecording = () => get("recorder")?.state === "recording";

function draw(recorder, { live }) {
  const running = recorder.state === "recording";
  button.disabled = !running && !live;
  button.classList.toggle("running", running);
  setText(button, running ? "Stop" : "Record");
  button.title = hint(running, live, recorder.name);
  rawChip.hidden = running || !live;
  status.classList.toggle("fault", recorder.state === "failed");
  setText(status, running ? figures(recorder) : recorder.state === "failed" ? "Recording\nended" : "");
}

function hint(running, live, name) {
  if (running) return `Stop recording ${name} (W)`;
  return live ? "Record the live source (W)" : "Only a live source can be recorded";
}

/** Two short lines. */
function figures({ raw: isRaw, size, duration, rate, dropped }) {
  const pace = [isRaw && "raw", `${bytes(rate)}/s`, dropped && `${dropped} dropped`].filter(Boolean);
  return `${clock(duration)} · ${bytes(size)}\n${pace.join(" · ")}`;
}

let before = null;

/** What has been recorded is offered; why a recording ended early is said. */
function tell(recorder) {
  const recorded = before?.state === "recording" ? before.name : null;
  before = recorder;
  if (!recorded || recorder.state === "recording") return;
  refreshRecordings();
  if (recorder.name) offer(recorder);
  else
    toast(`The part of ${recorded} that was written is in the recordings folder.`, { title: "Recording ended with the server" });
}

function offer(recorder) {
  const play = { label: "Play it", run: () => open({ kind: "recording", name: recorder.name }) };
  const facts = `${recorder.name}: ${clock(recorder.duration)}, ${bytes(recorder.size)}`;
  if (recorder.state === "failed")
    toast(recorder.error, { title: "Recording ended", kind: "error", action: play });
  else toast(facts, { title: "Recorded", action: play });
}
