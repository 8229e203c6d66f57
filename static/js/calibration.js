// The noise of this sensor: measured from scans of what plays while it stands still.

import { request } from "./api.js";
import { calibrationResult } from "./calibration-result.js";
import { $, el, remake, setText } from "./dom.js";
import { listProfiles, mountProfiles } from "./profiles.js";
import { attempt } from "./actions.js";
import { get, on, set } from "./store.js";

const ASK_MS = 400;
const [LEAST, PRESET, MOST] = ["10", "100", "300"];

const ABOUT =
  "Let the sensor stand still in a room with straight walls. The scatter of the ranges from scan to scan gives its noise.";

const scans = el("input", {
  type: "number",
  id: "calibration-scans",
  min: LEAST,
  max: MOST,
  value: PRESET,
  required: true,
});
const button = el("button", { type: "submit", class: "button" }, "Calibrate");
const bar = el("progress", { max: 1, value: 0, "aria-label": "Scans collected" });
const progressText = el("output", {});
const message = el("p", { id: "calibration-message", role: "status", hidden: true });
const progress = el(
  "div",
  { id: "calibration-progress", class: "job", hidden: true },
  bar,
  progressText,
  el("button", { type: "button", class: "button", onclick: cancel }, "Cancel"),
);

export function mountCalibration() {
  $("calibration").append(
    el("p", { class: "muted about" }, ABOUT),
    el(
      "form",
      { class: "row", id: "calibrate", onsubmit: start },
      el("label", { for: scans.id }, "Scans"),
      el("span", { class: "fields" }, scans, button),
    ),
    progress,
    message,
    el("div", { id: "calibration-result" }),
    el("div", { id: "profiles" }),
  );
  mountProfiles();
  on(["panel", "connection"], (panel, connection) => {
    if (panel !== "setup" || connection !== "open") return;
    ask();
    listProfiles();
  });
  on(["calibration"], draw);
  on(["calibration", "settings"], drawResult);
}

const isRunning = ({ state }) => state === "collecting" || state === "calculating";

function start(event) {
  event.preventDefault();
  return startCalibration();
}

/** Measures the noise of what plays from the scans that come. */
export async function startCalibration() {
  const wanted = { scans: Number(scans.value) };
  await attempt(() => request("POST", "calibration", wanted), "The calibration could not be started");
  await ask(); // another browser may have begun one
}

async function cancel() {
  await attempt(() => request("DELETE", "calibration"), "The calibration could not be cancelled");
  await ask();
}

let timer = 0;

/** Asks how far it is, again and again while it runs and is shown. */
async function ask() {
  clearTimeout(timer);
  const found = await request("GET", "calibration").catch(() => null);
  if (found) set("calibration", found);
  clearTimeout(timer); // of a question that was asked meanwhile
  if (found && isRunning(found) && get("panel") === "setup") timer = setTimeout(ask, ASK_MS);
}

function draw(calibration) {
  const { state, source, scans: taken, wanted, message: said } = calibration;
  progress.hidden = !isRunning(calibration);
  button.disabled = isRunning(calibration);
  bar.value = wanted ? taken / wanted : 0;
  setText(progressText, state === "calculating" ? "Calculating" : `${taken} of ${wanted} scans of ${source}`);
  setText(message, said ?? "");
  message.hidden = !said;
  message.className = state === "failed" ? "fault" : "muted";
}

function drawResult({ source, scans: taken, result }, { extraction }) {
  remake($("calibration-result"), [result, extraction.noise, document.documentElement.dataset.theme], () =>
    result ? calibrationResult(result, `${taken} scans of ${source}`, extraction.noise) : [],
  );
}
