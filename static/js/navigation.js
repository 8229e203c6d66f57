// Whether and how the sensor's pose is estimated: in which map, by which landmarks, from which motion.

import { request } from "./api.js";
import { choiceRow, segmentedRow } from "./bindings.js";
import { $, el, setText } from "./dom.js";
import { forget } from "./history.js";
import { placingControls } from "./placing.js";
import { attempt, changeSetting, setting, settings } from "./actions.js";
import { on } from "./store.js";
import { isOfScans } from "./pose.js";
import { showPanel } from "./tabs.js";
import { layerChips } from "./view.js";
import { posePanel } from "./pose-panel.js";

const MODES = { off: "Off", slam: "SLAM", localize: "Localize" };

const MOTIONS = [
  ["auto", "Auto"],
  ["odometry", "Odometry"],
  ["constant velocity", "Velocity"],
];

const MOTION_HINT =
  "What predicts the pose between scans. Auto: odometry when the source has it, else the velocity estimated so far";

const ABOUT = {
  off: "The view is drawn from the sensor. SLAM builds a map while the sensor moves; Localize finds the sensor in a map that there is.",
  slam: "Builds a map, which is kept in Maps below, and finds the sensor in it at the same time.",
  localize: "Finds the sensor in an existing map.",
};

const METHODS = [
  ["scans", "Whole scans"],
  ["corners", "Corners"],
  ["clusters", "Clusters"],
];

const METHOD_HINT =
  "What SLAM finds the pose by. Whole scans: each is matched to the last ones, and the map becomes a grid with walls. Corners and clusters: an extended Kalman filter on landmarks";

/** What SLAM finds the pose by: whole scans, or landmarks of a kind. */
const method = {
  value: () => (setting("navigation.method") === "scans" ? "scans" : setting("navigation.landmarks")),
  change: (value) =>
    settings.patch({
      navigation: value === "scans" ? { method: "scans" } : { method: "landmarks", landmarks: value },
    }),
};

const methodRow = choiceRow("Method", "slam-method", METHODS, method, { title: METHOD_HINT });
const landmarksRow = segmentedRow("Landmarks", "navigation.landmarks", METHODS.slice(1));
const motionRow = segmentedRow("Motion", "navigation.motion", MOTIONS, { title: MOTION_HINT });

const reset = el(
  "button",
  {
    type: "button",
    title: "SLAM starts over with an empty map, localization with an unknown pose",
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
    methodRow,
    landmarksRow,
    el(
      "p",
      { class: "muted", id: "cluster-hint" },
      "Posts, legs and trunks make good cluster landmarks; walls do not. Choose the clustering method in ",
      el("button", { type: "button", class: "link", onclick: showClusters }, "Setup, Clusters"),
    ),
    motionRow,
    posePanel(),
    el("div", { class: "buttons" }, ...placingControls(), reset),
  );
  on(["fields"], (fields) => $("navigation").append(layerChips(fields, { ofMap: true })));
  on(["settings", "localization", "mapped"], ({ navigation }, localization, { walls }) => {
    const { mode, landmarks } = navigation;
    const wholeScans = isOfScans(navigation, localization);
    const hasWalls = mode === "slam" || walls.length > 0; // a map that is localized in may have none
    $("map").dataset.of = mode === "off" ? "nothing" : !wholeScans ? "landmarks" : hasWalls ? "scans" : "grid";
    methodRow.hidden = mode === "localize";
    landmarksRow.hidden = mode !== "localize" || wholeScans;
    motionRow.hidden = wholeScans || mode === "off";
    $("cluster-hint").hidden = wholeScans || landmarks !== "clusters";
    setText($("mode-about"), ABOUT[mode]);
    reset.disabled = mode === "off";
  });
}

/** The next of off, SLAM and localize. */
export function nextMode() {
  const modes = Object.keys(MODES);
  changeSetting("navigation.mode", modes[(modes.indexOf(setting("navigation.mode")) + 1) % modes.length]);
}
