// The scene's frame: its keys reach the page's shortcuts, its tools are the page's buttons. What is drawn over it lies as
// its camera looks, or, while it has none, as a plain one does.

import { $ } from "./dom.js";
import { setting, toggleSetting } from "./actions.js";
import { Fading } from "./overlay/fading.js";
import { cornersOf, framingOf, including, isFramed } from "./overlay/framing.js";
import { Look, PlainCamera } from "./overlay/look.js";
import { letGo } from "./overlay/tools.js";
import { get, on } from "./store.js";

/** What the scene's frame offers, once it has started. */
export const view = () => $("scene").contentWindow?.lidarView;

const NUMBERS_PX = 20; // of the grid, below
const narrow = matchMedia("(max-width: 899px)");
const plain = new PlainCamera(() => sheetNow());
const fading = new Fading(() => get("tools").fade);

/** How the floor is seen now. */
export function lookNow() {
  const { width, height } = sheetNow();
  return new Look(view()?.floorToWindow() ?? plain.floorToWindow(), width, height);
}

/** The camera that the pointer moves over a scene that has none; else null. */
export const plainCamera = () => (view()?.floorToWindow() ? null : plain);

const handlers = new Map(); // by the type of the message

/** Calls `run(message)` for messages of a type from the scene's frame. */
export const onSceneMessage = (type, run) => handlers.set(type, run);

/** `press(event)` receives the keys pressed in the scene. */
export function mountScene(press) {
  onSceneMessage("keydown", press);
  onSceneMessage("dragged", letGo);
  $("fit").addEventListener("click", () => fitScene());
  $("rotate").addEventListener("click", () => toggleSetting("view.rotate"));
  $("scene").addEventListener("load", begin);
  watchSheet();
  on(["settings"], () => {
    applyRotation();
    hideLayers();
  });
  const stop = on(["frame"], () => {
    requestAnimationFrame(() => setTimeout(() => ($("scene").src = "viser/")));
    stop();
  });
  for (const key of ["frame", "tools", "mapped", "landmarks", "localization"]) on([key], look);
  window.addEventListener("message", ({ origin, source, data }) => {
    const ours = origin === location.origin && source === $("scene").contentWindow;
    if (ours) handlers.get(data?.type)?.(data);
  });
}

/** With what the scene's frame has to know from its start. It takes long, so the first frame is drawn without it. */
function begin() {
  $("stage").classList.remove("waiting");
  applyRotation();
  hideLayers();
  view()?.onTick((scene) => fading.tick(scene));
  look();
}

function look() {
  const framing = framed(get("frame"));
  if (!framing) return;
  plain.look(framing);
  view()?.look(framing);
}

function framed(frame) {
  if (!frame) return undefined;
  const extent = extentOf(frame);
  const framing = framingOf(extent, frame.localization?.pose, get("tools"), sheetNow());
  return { ...framing, isFramed: isFramed(extent, lookNow(), get("tools"), sheetNow()) };
}

/** What is to be seen: what the scan sees, and all of the map, unless the view goes along with the sensor. */
function extentOf({ extent, localization }) {
  if (!localization || get("tools").follow) return extent;
  const walls = get("mapped").walls.flatMap(({ ends }) => ends);
  const landmarks = [...(get("landmarks")?.values() ?? [])].map(({ x, y }) => [x, y]);
  const grid = get("localization")?.extent ?? [[], []];
  return including(extent, [...walls, ...landmarks, ...cornersOf(grid)]);
}

let sheet = null; // as it was measured last

const sheetNow = () => (sheet ??= measuredSheet());

/** Measured anew, as that takes time, only when something over the view comes, goes or changes its size. */
function watchSheet() {
  const renew = () => {
    sheet = null;
    look();
  };
  const sizes = new ResizeObserver(renew);
  for (const id of ["stage", "legend", "banner"]) sizes.observe($(id)); // which hides the welcome
  new MutationObserver(renew).observe($("stage"), { childList: true });
}

/** The size of the view, and how much of its edges is taken, in pixels; on a narrow page that would leave too little. */
function measuredSheet() {
  const { clientWidth: width, clientHeight: height } = $("stage");
  const [legend, tools, strip] = [$("legend"), $("scene-tools"), $("welcome")];
  if (narrow.matches) {
    const bottom = legend.open ? NUMBERS_PX : height - legend.offsetTop;
    return { width, height, left: 0, right: 0, top: 0, bottom };
  }
  const left = legend.open ? legend.offsetLeft + legend.offsetWidth : 0;
  const top = strip ? strip.offsetTop + strip.offsetHeight : 0;
  return { width, height, left, right: width - tools.offsetLeft, top, bottom: NUMBERS_PX };
}

/** Fits the room of a frame, else of the newest one, in the view. */
export function fitScene(frame = get("frame")) {
  const framing = framed(frame);
  plain.fit(framing);
  view()?.fit(framing);
}

function applyRotation() {
  const wanted = setting("view.rotate");
  if (wanted === undefined) return;
  $("rotate").setAttribute("aria-pressed", String(wanted));
  view()?.setRotate(wanted);
}

/** Nodes of the scene by the layers that someone may hide here only. */
const NODES = {
  points: "/body/points",
  segments: "/body/segments",
  rejected: "/body/rejected",
  gaps: "/body/gaps",
  clusters: "/body/clusters",
  trail: "/trails/estimated",
  dead_reckoned: "/trails/reckoned",
  truth: "/trails/true",
  occupancy: "/occupancy",
  walls: "/walls",
  associations: "/associations",
};

function hideLayers() {
  const layers = setting("view.layers");
  if (layers) view()?.hide(Object.keys(NODES).filter((layer) => !layers[layer]).map((layer) => NODES[layer]));
}
