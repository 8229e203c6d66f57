// How this browser looks at the scene, which it remembers: the sensor stays in the middle, its heading up, and so many of
// the last scans fade out. The store has it as "tools".

import { changeSetting } from "../actions.js";
import { $ } from "../dom.js";
import { get, on, set } from "../store.js";
import { clearToasts, toast } from "../toasts.js";

const KEY = "tools";
const PRESET = { follow: false, heading_up: false, fade: 0 };
const BUTTONS = { follow: "follow", heading_up: "heading-up" };
const AT_REST = "As long as nothing says where the sensor is, the view is drawn from it: it lies at zero and looks along x.";
const UNKNOWN = "Where the sensor is, is not known yet. The view goes along as soon as it is.";

/** What controls are tied to (bindings.js). */
export const TOOLS = {
  key: "tools",
  value: (name) => get("tools")?.[name],
  change: (name, value) => keep({ ...get("tools"), [name]: Number(value) }),
};

export function mountTools() {
  set("tools", { ...PRESET, ...stored() });
  for (const [name, id] of Object.entries(BUTTONS)) {
    $(id).addEventListener("click", () => toggleTool(name));
    on(["tools"], (tools) => $(id).setAttribute("aria-pressed", String(tools[name])));
  }
}

/** Turns following or heading-up on or off. */
export function toggleTool(name) {
  const tools = { ...get("tools"), [name]: !get("tools")[name] };
  keep(tools);
  clearToasts("pose");
  if (tools[name]) explain();
}

/** Someone moves the view elsewhere. */
export function letGo() {
  if (get("tools").follow) toggleTool("follow");
}

function keep(tools) {
  localStorage.setItem(KEY, JSON.stringify(tools));
  set("tools", tools);
}

function stored() {
  try {
    return JSON.parse(localStorage.getItem(KEY));
  } catch {
    return null; // not ours
  }
}

/** Without a pose there is nothing to go along with. */
function explain() {
  const localization = get("frame")?.localization;
  if (localization?.state === "starting") toast(UNKNOWN, { about: "pose" });
  if (localization || !get("frame")) return;
  const action = { label: "Start SLAM", run: () => changeSetting("navigation.mode", "slam") };
  toast(AT_REST, { title: "No pose", action, about: "pose" });
}
