// On the first visit, a strip over the view: what is on the screen in a sentence, and three ways to go on. It goes with
// one click and does not come back in this browser.

import { open, select, settings } from "./actions.js";
import { startCalibration } from "./calibration.js";
import { $, el, iconButton, setText } from "./dom.js";
import { get, on } from "./store.js";
import { showPanel } from "./tabs.js";

const KEY = "welcomed";

const SEEN =
  "Points are where beams met something, lines the walls fitted to them, and each ellipse says how well a corner is known.";

const WHENCE = {
  device: "Your lidar, live.",
  emulator: "An emulated lidar in a furnished room.",
  simulation: "A simulated robot and what its lidar sees.",
  recording: "A recording, played again.",
};

const STEPS = [
  ["Compare methods", "Which method's ellipse is true? Shows all methods on one corner, with the ellipses their papers publish", compare],
  ["Calibrate my sensor", "Measures the noise of this sensor, so that its ellipses are true. Keep it still meanwhile", calibrate],
  ["Build a map", "A simulated robot drives through an office where people walk, and the map grows", buildMap],
];

export function mountWelcome() {
  if (localStorage.getItem(KEY)) return;
  const sentence = el("p");
  const buttons = STEPS.map(([label, title, run]) => {
    const onclick = () => {
      close();
      run();
    };
    return el("button", { type: "button", class: "button", title, onclick }, label);
  });
  const strip = el(
    "aside",
    { id: "welcome", class: "welcome", "aria-label": "First steps" },
    sentence,
    el("div", { class: "buttons" }, ...buttons, iconButton("close", "Close the first steps", close)),
  );
  $("stage").append(strip);
  on(["source"], ({ kind }) => setText(sentence, `${WHENCE[kind]} ${SEEN}`));
}

function close() {
  localStorage.setItem(KEY, "yes");
  $("welcome").remove();
}

/** All methods with the ellipses of their papers, held against the scatter, on a corner that all of them found. */
async function compare() {
  const methods = get("methods").map(({ name }) => name);
  showPanel("repeatability");
  await settings.patch({
    view: { compare: true, methods },
    extraction: { covariance: "published" },
    repeatability: { running: true },
  });
  let isAsked = false;
  const stop = on(["frame"], async (frame) => {
    const id = bestCorner(frame, methods);
    if (id === null || isAsked) return;
    isAsked = true;
    isAsked = await select({ corner: id }); // one that is gone by then is looked for again
    if (isAsked) stop();
  });
}

/** The squarest of the corners that all methods found: its ellipses are the roundest. */
function bestCorner({ corners }, methods) {
  const common = corners.filter(({ by_method: found }) => methods.every((name) => found[name]));
  const angle = ({ by_method: found }) => found[methods[0]].angle;
  return common.sort((one, other) => angle(other) - angle(one))[0]?.id ?? null;
}

function calibrate() {
  showPanel("setup");
  $("calibration").scrollIntoView({ block: "start" });
  startCalibration();
}

async function buildMap() {
  showPanel("map");
  if (!(await open({ kind: "simulation", settings: { world: "office", people: 4 } }))) return;
  await settings.patch({ navigation: { mode: "slam", method: "scans" } });
}
