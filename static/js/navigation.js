// Whether and how the sensor's pose is estimated: in which map, by which landmarks, from which motion.

import { request } from "./api.js";
import { segmentedRow } from "./bindings.js";
import { $, el, setText } from "./dom.js";
import { forget } from "./history.js";
import { placingControls } from "./placing.js";
import { attempt, changeSetting, setting } from "./session.js";
import { on } from "./store.js";
import { showPanel } from "./tabs.js";
import { layerChips } from "./view.js";
import { whereabouts } from "./whereabouts.js";

const MODES = { off: "Off", slam: "SLAM", localize: "Localize" };

const MOTIONS = [
  ["auto", "Auto"],
  ["odometry", "Odometry"],
  ["constant velocity", "Velocity"],
];

const MOTION_HINT =
  "What predicts the pose between scans. Auto: odometry when the source has it, else the velocity estimated so far";

const ABOUT = {
  off: "The sensor is taken to stand still, and the scene shows what it sees.",
  slam: "Builds a map of landmarks and finds the sensor in it at the same time.",
  localize: "Finds the sensor in a map that was built before.",
};

const reset = el(
  "button",
  {
    type: "button",
    title: "SLAM begins with an empty map, localization with no idea of the pose",
    onclick: () => attempt(begin, "The filter was not reset"),
  },
  "Reset",
);

async function begin() {
  await request("POST", "localization/reset");
  forget();
}

/** Where to choose what finds clusters. */
function showClusters() {
  showPanel("setup", { focus: true });
  $("clusters").scrollIntoView();
}

export function mountNavigation() {
  $("navigation").append(
    segmentedRow("Mode", "navigation.mode", Object.entries(MODES), { "aria-describedby": "mode-about" }),
    el("p", { class: "muted about", id: "mode-about" }),
    segmentedRow("Landmarks", "navigation.landmarks", [
      ["corners", "Corners"],
      ["clusters", "Clusters"],
    ]),
    el(
      "p",
      { class: "muted", id: "cluster-hint" },
      "Walls make no good landmarks; posts, legs and trunks do. What finds them: ",
      el("button", { type: "button", class: "link", onclick: showClusters }, "Setup, Clusters"),
    ),
    segmentedRow("Motion", "navigation.motion", MOTIONS, { title: MOTION_HINT }),
    whereabouts(),
    el("div", { class: "buttons" }, ...placingControls(), reset),
  );
  on(["fields"], (fields) => $("navigation").append(layerChips(fields, { ofMap: true })));
  on(["settings"], ({ navigation: { mode, landmarks } }) => {
    $("cluster-hint").hidden = landmarks !== "clusters";
    setText($("mode-about"), ABOUT[mode]);
    reset.disabled = mode === "off";
  });
}

/** The next of off, SLAM and localize. */
export function nextMode() {
  const modes = Object.keys(MODES);
  changeSetting("navigation.mode", modes[(modes.indexOf(setting("navigation.mode")) + 1) % modes.length]);
}
