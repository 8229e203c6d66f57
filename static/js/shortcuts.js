// Keyboard shortcuts, declared once: they work, and the help dialog lists them.

import { nextCorner } from "./corners.js";
import { $, el } from "./dom.js";
import { nextLandmark } from "./landmarks.js";
import { nextMapped } from "./mapped-table.js";
import { toggleMethod } from "./method.js";
import { nextMode } from "./navigation.js";
import { cancelMeasure, toggleMeasure } from "./overlay/measure.js";
import { toggleTool } from "./overlay/tools.js";
import { cancelPlacing, togglePlacing } from "./placing.js";
import { toggleRecording } from "./recorder.js";
import { fitScene } from "./scene.js";
import {
  changeSetting,
  selectNothing,
  setting,
  step,
  togglePlaying,
  toggleSetting,
  transport,
} from "./actions.js";
import { get } from "./store.js";
import { toggleTheme } from "./theme.js";
import { closeNewest, refuse } from "./toasts.js";

const LAYERS = {
  p: "points",
  s: "segments",
  o: "corners",
  e: "ellipses",
  k: "clusters",
  x: "rejected",
  g: "grid",
};
const KEY_NAMES = {
  " ": "Space",
  ArrowLeft: "←",
  ArrowRight: "→",
  ArrowUp: "↑",
  ArrowDown: "↓",
  Escape: "Esc",
};

const SHORTCUTS = [
  { keys: [" "], about: "Play or pause", run: togglePlaying },
  {
    keys: ["ArrowLeft", "ArrowRight"],
    about: "Step back, forward",
    run: (key) => step(key === "ArrowLeft" ? -1 : 1),
  },
  { keys: ["Home"], about: "Back to the first scan", run: toFirst },
  { keys: ["l"], about: "Loop", run: () => transport.patch({ loop: !get("source").loop }) },
  { keys: ["w"], about: "Record, stop recording", run: toggleRecording },
  { keys: ["1", "…", "6"], about: "Fitter", run: chooseFitter },
  { keys: ["⇧1", "…", "⇧6"], about: "Show a method in the comparison" },
  { keys: ["c"], about: "Compare methods", run: () => toggleSetting("view.compare") },
  { keys: ["v"], about: "Consistent or published covariance", run: swapCovariance },
  {
    keys: Object.keys(LAYERS),
    about: "Points, walls, corners, ellipses, clusters, rejected, grid",
    run: (key) => toggleSetting(`view.layers.${LAYERS[key]}`),
  },
  { keys: ["-", "+"], about: "Smaller, larger ellipses", run: scaleEllipses },
  {
    keys: ["ArrowUp", "ArrowDown"],
    about: "Previous, next corner; landmark or wall of the map while that is open",
    run: (key) => nextThing()(key === "ArrowUp" ? -1 : 1),
  },
  { keys: ["Escape"], about: "Answer a question with no, stop setting the pose or measuring, close the newest message, or clear the selection", run: giveUp },
  { keys: ["m"], about: "Off, SLAM, localize", run: nextMode },
  { keys: ["i"], about: "Set the pose by dragging", run: togglePlacing },
  { keys: ["d"], about: "Measure a distance", run: toggleMeasure },
  { keys: ["f"], about: "Fit the room in the view", run: () => fitScene() },
  { keys: ["n"], about: "Keep the sensor in the middle", run: () => toggleTool("follow") },
  { keys: ["h"], about: "The sensor's heading up", run: () => toggleTool("heading_up") },
  { keys: ["r"], about: "Rotate freely", run: () => toggleSetting("view.rotate") },
  { keys: ["t"], about: "Light or dark", run: toggleTheme },
  { keys: ["?"], about: "This help", run: showHelp },
];

export function mountShortcuts() {
  document.addEventListener("keydown", (event) => {
    if (!event.defaultPrevented && !keptBy(event.target, event.key) && press(event)) event.preventDefault();
  });
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && !keptBy(event.target, " ") && !inDialog()) event.preventDefault(); // no click on top
  });
  $("help").addEventListener("click", showHelp);
}

/** Runs the shortcut of a key, here or forwarded from the scene. Returns whether there is one. */
export function press({
  key,
  code = "",
  shiftKey = false,
  ctrlKey = false,
  metaKey = false,
  altKey = false,
}) {
  const busy = inDialog() || !get("source");
  if (ctrlKey || metaKey || altKey || busy) return false;
  const digit = /^(?:Digit|Numpad)([1-6])$/.exec(code)?.[1] ?? (/^[1-6]$/.test(key) ? key : null);
  if (digit) return shiftKey ? compareWith(digit) : chooseFitter(digit);
  const wanted = key.length === 1 ? key.toLowerCase() : key;
  const found = SHORTCUTS.find(({ keys, run }) => run && keys.includes(wanted === "=" ? "+" : wanted));
  found?.run(wanted);
  return Boolean(found);
}

const inDialog = () => document.querySelector("dialog[open]");

/** Whether the focused control uses the key itself. Space plays and pauses; Enter is there to press buttons. */
function keptBy(target, key) {
  if (target.matches('select, textarea, input:not([type="checkbox"], [type="range"])')) return true;
  if (target.matches('input[type="range"]')) return key.startsWith("Arrow") || key === "Home";
  return key === " " && target.matches("input:focus-visible");
}

const fitterOf = (digit) => get("methods")?.[Number(digit) - 1]?.name;

function chooseFitter(digit) {
  const name = fitterOf(digit);
  if (name) changeSetting("extraction.fitter", name);
  return Boolean(name);
}

function compareWith(digit) {
  const name = fitterOf(digit);
  if (name) toggleMethod(name);
  return Boolean(name);
}

/** The first of these that there is. */
function giveUp() {
  return refuse() || cancelPlacing() || cancelMeasure() || closeNewest() || selectNothing();
}

function nextThing() {
  if (get("panel") !== "map") return nextCorner;
  return get("mapped").walls.length ? nextMapped : nextLandmark;
}

/** The first scan there is; of a live source that is the oldest one kept. */
function toFirst() {
  transport.patch(get("source").live ? { index: 0, state: "paused" } : { index: 0 });
}

function swapCovariance() {
  const other = setting("extraction.covariance") === "published" ? "consistent" : "published";
  changeSetting("extraction.covariance", other);
}

function scaleEllipses(key) {
  const scale = setting("view.ellipse_scale") * (key === "-" ? 1 / 1.25 : 1.25);
  changeSetting("view.ellipse_scale", Math.min(100, Math.max(1, Number(scale.toPrecision(2)))));
}

function showHelp() {
  const dialog = $("help-dialog");
  const rows = SHORTCUTS.map(({ keys, about }) =>
    el(
      "tr",
      {},
      el(
        "th",
        { scope: "row" },
        ...keys.flatMap((key) => (key === "…" ? [" … "] : [el("kbd", {}, keyName(key)), " "])),
      ),
      el("td", {}, about),
    ),
  );
  const close = el(
    "button",
    { type: "button", class: "button strong", onclick: () => dialog.close() },
    "Close",
  );
  const table = el(
    "table",
    { class: "keys" },
    el("caption", { class: "visually-hidden" }, "Keys and what they do"),
    el("tbody", {}, ...rows),
  );
  dialog.replaceChildren(
    el("h2", { id: "help-title" }, "Keyboard shortcuts"),
    table,
    el("div", { class: "dialog-buttons" }, close),
  );
  dialog.showModal();
}

const keyName = (key) => KEY_NAMES[key] ?? (key.length === 1 ? key.toUpperCase() : key);
