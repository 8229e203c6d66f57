// What lies over the scene: grid, marks, ellipses, what is selected and pointed at. Drawn anew when anything of it, or the
// camera, has changed; clicks select.

import { attempt, select } from "../actions.js";
import { request } from "../api.js";
import { token } from "../chart.js";
import { methodColour } from "../colours.js";
import { $, setText } from "../dom.js";
import { isMapFirst, selectMapped } from "../mapped.js";
import { lookNow, plainCamera, view as camera } from "../scene.js";
import { selectedWall, selectWall } from "../selected-wall.js";
import { get, on, set } from "../store.js";
import { fixed } from "../units.js";
import { lookAround } from "./around.js";
import { drawGrid, scaleBar } from "./grid.js";
import { chosenAt, measurableAt, speckAt, thingsAt, wallsAt } from "./hits.js";
import { showHover } from "./hover.js";
import { drawMapped, drawMarks, drawPlace, drawPoints, drawWalls } from "./marks.js";
import { drawMeasure, isMeasuring, measureFrom, mountMeasure, toggleMeasure } from "./measure.js";
import { CanvasPen, SvgPen } from "./pens.js";
import { listen } from "./pointer.js";
import { download, sheetScale, svgFile } from "./save.js";
import { worldOf } from "./world.js";

const TOKENS = {
  text: "--text", halo: "--scene", line: "--grid", axis: "--grid-axis", number: "--muted", rejected: "--bad",
  sensor: "--strong", ring: "--selected-mark", landmark: "--landmark", tentative: "--tentative", trail: "--trail",
  wall: "--wall",
};

let world = null;
let colours = null; // in a theme
let pointed = null; // the pixel that the pointer is at
let due = 0;
const heard = new WeakSet(); // documents of the scene's frame

export function mountOverlay() {
  set("around", { beams: [], poses: [] });
  on(["frame"], (frame) => (world = worldOf(frame, get("landmarks") ?? new Map(), get("mapped"))));
  for (const key of ["landmarks", "mapped"])
    on([key], () => get("frame") && (world = worldOf(get("frame"), get("landmarks") ?? new Map(), get("mapped"))));
  for (const key of ["frame", "settings", "selection", "wall", "mappedWall", "mapped", "landmarks", "methods", "measure", "place", "around", "tools"]) on([key], redraw);
  new ResizeObserver(redraw).observe($("stage"));
  $("legend").addEventListener("toggle", redraw);
  $("scene").addEventListener("load", follow);
  follow();
  mountButtons();
}

/** The buttons of what one can do with the view; the pointer says what each is called. */
function mountButtons() {
  for (const button of document.querySelectorAll(".scene-tools button, .bar button.icon")) button.title = button.getAttribute("aria-label");
  $("scene-tools").addEventListener("click", ({ target }) => unfold(target.closest("#view-tools") && !isUnfolded()));
  mountMeasure();
  $("measure").addEventListener("click", toggleMeasure);
  $("fullscreen").addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : $("stage").requestFullscreen()));
  for (const kind of ["png", "svg"]) $(`save-${kind}`).addEventListener("click", () => saveView(kind));
}

const isUnfolded = () => $("scene-tools").classList.contains("open");

/** On a narrow page the buttons are folded into one; each folds them again. */
function unfold(wanted) {
  $("scene-tools").classList.toggle("open", Boolean(wanted));
  $("view-tools").setAttribute("aria-expanded", String(Boolean(wanted)));
}

/** Draws with the scene's camera, and has its pointer. */
function follow() {
  const { contentDocument: inside } = $("scene");
  if (heard.has(inside)) return;
  heard.add(inside);
  camera()?.onLook(draw);
  listen(inside, { click, hover, camera: movable });
}

/** Draws at the next animation frame. */
export function redraw() {
  due ||= requestAnimationFrame(draw);
}

function draw() {
  cancelAnimationFrame(due);
  due = 0;
  if (!world || !get("methods") || !get("settings")) return;
  if (pointed) lookAround();
  if (colours?.theme !== theme()) colours = { theme: theme(), ...coloursNow() };
  const look = lookNow();
  const pen = new CanvasPen(cleared(look));
  drawOver(pen, look, legendBox());
}

/** What the legend covers of the view. */
function legendBox() {
  const { offsetLeft: left, offsetTop: top, offsetWidth: width, offsetHeight: height } = $("legend");
  return { right: left + width, top, bottom: top + height };
}

/** Draws all there is with a pen, as seen by a look; what covers the lower left corner hides none of a number in part. */
export function drawOver(pen, look, covered = null) {
  const { view, sensor } = get("settings");
  const selection = { ...get("selection"), wall: selectedWall(world.frame)?.id, mapped: get("mappedWall") };
  const hovered = pointed ? thingsAt(world, view.layers, look, pointed) : [];
  if (view.layers.grid) drawGrid(pen, look, { ...colours, text: colours.number }, covered);
  if (view.layers.walls && plainCamera()) drawMapped(pen, look, world, colours);
  if (view.layers.segments && plainCamera()) drawWalls(pen, look, world, colours);
  tell(drawMarks(pen, look, world, { view, mask: sensor.mask ?? [], selection, hovered, colours }));
  if (get("place")) drawPlace(pen, look, get("place"), colours);
  drawMeasure(pen, look, colours);
  const speck = pointed && speckAt(get("around"), view.layers, look, pointed);
  showHover(isMeasuring() ? [] : [...hovered, speck].filter(Boolean), pointed); // it would hide what is measured
  showScale(look);
}

/** A bar of a round length, on the screen as long as it is on the floor. */
function showScale(look) {
  const { length, pixels } = scaleBar(look);
  $("scale-bar").hidden = !Number.isFinite(pixels);
  $("scale-bar").style.width = `${pixels}px`;
  setText($("scale-bar"), length < 1 ? `${fixed(100 * length, 0)}\u2009cm` : `${fixed(length, 0)}\u2009m`);
}

/** Saves what is seen: points, walls and all marks, as SVG at a round scale, or as PNG. */
export async function saveView(kind) {
  const look = lookNow();
  const scan = await attempt(() => request("GET", "frame?points=true"), "The points could not be read");
  if (!scan) return;
  const name = `lidarcore-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}`;
  const put = (pen) => {
    drawPoints(pen, look, scan, colours.number);
    if (get("settings").view.layers.walls) drawMapped(pen, look, world, colours);
    drawWalls(pen, look, world, colours);
    drawOver(pen, look);
  };
  if (kind === "svg") {
    const pen = new SvgPen();
    put(pen);
    const scale = sheetScale(look);
    download(svgFile(pen, look, scale, colours.halo), `${name}-1-${scale}.svg`);
  } else {
    const canvas = new OffscreenCanvas(2 * look.width, 2 * look.height);
    const context = canvas.getContext("2d");
    context.scale(2, 2);
    context.fillStyle = colours.halo;
    context.fillRect(0, 0, look.width, look.height);
    put(new CanvasPen(context));
    download(await canvas.convertToBlob(), `${name}.png`);
  }
}

/** How many ellipses have another size than theirs: the legend says so. */
function tell(sizes) {
  const known = get("sizes");
  if (known?.grown !== sizes.grown || known?.shrunk !== sizes.shrunk) set("sizes", sizes);
}

/** The context of the canvas, empty, in pixels of the page. */
function cleared({ width, height }) {
  const canvas = $("overlay");
  const ratio = devicePixelRatio;
  const [wide, high] = [width, height].map((side) => Math.round(side * ratio));
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

function click(pixel, within) {
  if (!world) return;
  if (isMeasuring()) return void measureFrom(measurableAt(world, lookNow(), pixel, within));
  const { layers } = get("settings").view;
  const { corner, landmark } = chosenAt(world, layers, lookNow(), pixel, within);
  const change = { ...(corner !== undefined && { corner }), ...(landmark !== undefined && { landmark }) };
  if (Object.keys(change).length) return void select(change);
  const walls = wallsAt(world, layers, lookNow(), pixel, within);
  const [wall] = isMapFirst() ? walls.reverse() : walls;
  if (wall?.kind === "mapped") selectMapped(wall.id);
  else if (wall) selectWall(world.frame, wall);
}

function hover(pixel) {
  pointed = pixel;
  redraw();
}

/** The plain camera, if it is the one; what it shows is drawn anew. */
function movable() {
  if (plainCamera()) redraw();
  return plainCamera();
}

const theme = () => document.documentElement.dataset.theme;

function coloursNow() {
  const tokens = Object.entries(TOKENS).map(([name, of]) => [name, token(of)]);
  const methods = get("methods").map(({ name, dash }) => [name, { colour: methodColour(name), dash }]);
  return { ...Object.fromEntries(tokens), methods: Object.fromEntries(methods) };
}
