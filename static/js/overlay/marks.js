// What is drawn over the scene: marks with sizes of the screen, and outlines of ellipses on top of them.

import { axesOf, drawable, outlineOf, SIGMAS } from "./ellipses.js";
import { placer } from "./world.js";

const CORNER_PX = 6; // across
const POINT_PX = 3;
const LANDMARK_PX = 7;
export const LANDMARK_SIGMAS = 10; // of their ellipses, which at one would be hidden by their marks
const CROSS_PX = 4; // from the middle to an end
const ARROW = [[-0.7, -0.6], [1, 0], [-0.7, 0.6]]; // of the sensor
const ARROW_PX = 9;
const RING_PX = 12;
const ARC_STEP = 0.05; // rad along the rim of a sector
const WEDGE = 0.2; // of what fills it
const THIN = 0.12; // of what fills an ellipse
const FAINT = 0.4; // of the outline of one that does not fit into the view, and is not filled, and of walls not placed
const FADED_S = 60; // after which a landmark that is not seen looks its palest
const PALEST = 0.45;
const FEW = 40; // landmarks that have room for their numbers

/**
 * Draws a world as it is seen by a look. `view` are the settings, `mask` the sectors left out, `selection` the ids
 * chosen, `hovered` all that is pointed at, `colours` those of methods and tokens. Ellipses of
 * corners and landmarks are enlarged, that of the sensor holds 95 %. Returns how many have another size: {grown, shrunk}.
 */
export function drawMarks(pen, look, world, { view, mask, selection, hovered, colours }) {
  const { layers, ellipse_scale: scale } = view;
  const sizes = { grown: 0, shrunk: 0 };
  const ellipses = (entries) => drawEllipses(pen, look, entries, sizes);
  if (layers.landmarks) drawLandmarks(pen, look, world, { ellipses, colours });
  if (layers.rejected) drawRejections(pen, look, world, colours);
  if (layers.pose && world.frame.localization && world.isPlaced) drawPose(world, { ellipses, colours });
  if (layers.sensor) for (const sector of mask) drawSector(pen, look, world.sensor, sector, colours);
  if (layers.sensor) drawSensor(pen, look, world.sensor, colours);
  for (const corner of world.corners) {
    if (layers.corners) drawCorner(pen, look, corner, colours);
    if (layers.ellipses) ellipses(ellipsesOf(corner, scale, colours));
  }
  if (!world.isPlaced) label(pen, look, world.sensor.at, "Not placed in the map", colours);
  drawChosen(pen, look, world, { selection, hovered, colours });
  return sizes;
}

/** The walls of the main method, where no scene shows them. */
export function drawWalls(pen, look, { frame, walls, isPlaced }, { methods }) {
  const opacity = isPlaced ? 1 : FAINT;
  for (const wall of walls) along(pen, look, wall, { stroke: methods[frame.methods[0]].colour, width: 2, opacity });
}

/** The walls of the map, where no scene shows them. */
export function drawMapped(pen, look, { mapped }, { wall: stroke }) {
  for (const wall of mapped.walls) along(pen, look, wall, { stroke, width: 2 });
}

/** The measured points of a frame that has them, where no scene shows them. */
export function drawPoints(pen, look, { points, localization }, colour) {
  const place = placer(localization?.pose);
  for (const point of points) dot(pen, look, place(point), POINT_PX, colour);
}

/** A corner in the colour of the main method; where others see it is dotted smaller. */
function drawCorner(pen, look, { measured }, colours) {
  for (const { method, at } of measured.toReversed())
    dot(pen, look, at, method === measured[0].method ? CORNER_PX : CORNER_PX / 2, colours.methods[method].colour);
}

const ellipsesOf = ({ measured }, scale, { methods }) =>
  measured.map(({ method, at, covariance }) => ({ at, ...scaled(axesOf(covariance), scale), ...methods[method] }));

const scaled = ({ long, short, direction }, by) => ({ long: by * long, short: by * short, direction });

/** The ellipses around one place: what fills them, and on top of all that the outlines, the main method's last. */
function drawEllipses(pen, look, entries, sizes) {
  const shown = drawable(entries, look)
    .map((ellipse) => ({ ...ellipse, points: outlineOf(ellipse.at, ellipse).map((place) => look.toScreen(place)) }))
    .filter(({ points }) => points.every(Boolean))
    .reverse();
  for (const { points, colour, size } of shown)
    if (size !== "shrunk") pen.path(points, { fill: colour, opacity: THIN / shown.length, closed: true });
  for (const { points, colour, dash, opacity = 1, size } of shown) {
    if (size !== "true") sizes[size]++;
    pen.path(points, { stroke: colour, dash, opacity: size === "shrunk" ? FAINT * opacity : opacity, closed: true });
  }
}

function drawLandmarks(pen, look, { frame, landmarks, tentative }, { ellipses, colours }) {
  for (const at of tentative) dot(pen, look, at, LANDMARK_PX, colours.tentative);
  for (const landmark of landmarks) {
    const age = Math.min(1, Math.max(0, (frame.stamp - landmark.last_seen) / FADED_S));
    const opacity = 1 - age * (1 - PALEST);
    dot(pen, look, landmark.at, LANDMARK_PX, colours.landmark, opacity);
    ellipses([{ at: landmark.at, ...scaled(axesOf(landmark.covariance), LANDMARK_SIGMAS), colour: colours.landmark, opacity }]);
    if (landmarks.length <= FEW) label(pen, look, landmark.at, `L${landmark.id}`, colours);
  }
}

function drawRejections(pen, look, { rejections }, { rejected }) {
  for (const { candidate, at } of rejections) {
    const middle = look.toScreen(at);
    if (!middle || candidate === "segment") continue; // the scene has the points of those
    for (const side of [-1, 1])
      pen.path([-CROSS_PX, CROSS_PX].map((way) => [middle[0] + way, middle[1] + side * way]), { stroke: rejected, width: 2 });
  }
}

function drawPose({ frame, sensor }, { ellipses, colours }) {
  const [[xx, xy], [, yy]] = frame.localization.covariance;
  ellipses([{ at: sensor.at, ...scaled(axesOf([[xx, xy], [xy, yy]]), SIGMAS), colour: colours.trail }]);
}

/** A wedge in which what is near is left out, as it is the robot itself. */
function drawSector(pen, look, { at, heading }, { first, last, reach }, { sensor }) {
  const turn = 2 * Math.PI;
  const width = Math.abs(last - first) >= turn - 1e-9 ? turn : (((last - first) % turn) + turn) % turn;
  const steps = Math.ceil(width / ARC_STEP);
  const arc = Array.from({ length: steps + 1 }, (_, k) => heading + first + (width * k) / Math.max(steps, 1));
  const rim = arc.map((b) => [at[0] + reach * Math.cos(b), at[1] + reach * Math.sin(b)]);
  const points = [at, ...rim].map((place) => look.toScreen(place));
  if (!points.every(Boolean)) return;
  pen.path(points, { fill: sensor, opacity: WEDGE, closed: true });
  pen.path(points, { stroke: sensor, width: 1, dash: [4, 3], closed: true });
}

function drawSensor(pen, look, { at, heading }, { sensor, halo }) {
  const reach = ARROW_PX / look.scale; // m
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  const ends = ARROW.map(([u, v]) => look.toScreen([at[0] + reach * (c * u - s * v), at[1] + reach * (s * u + c * v)]));
  if (!ends.every(Boolean)) return;
  pen.path(ends, { stroke: halo, width: 3, closed: true });
  pen.path(ends, { fill: sensor, closed: true });
}

/** What is selected, ringed; what is pointed at, ringed thinly. */
function drawChosen(pen, look, { corners, landmarks, walls, mapped }, { selection, hovered, colours }) {
  const chosen = [
    ...corners.filter(({ id }) => id === selection.corner),
    ...landmarks.filter(({ id }) => id === selection.landmark),
  ];
  for (const thing of chosen) ring(pen, look, thing, { stroke: colours.ring, width: 3 });
  const wall = walls.find(({ id }) => id === selection.wall) ?? mapped.walls.find(({ id }) => id === selection.mapped);
  if (wall) along(pen, look, wall, { stroke: colours.ring, width: 4 });
  for (const thing of hovered) {
    if (thing.ends) along(pen, look, thing, { stroke: colours.text, width: 4, opacity: 0.6 });
    else if (!chosen.includes(thing)) ring(pen, look, thing, { stroke: colours.text, width: 1.5 });
  }
}

/** A stroke from one end of a wall to the other. */
function along(pen, look, { ends }, style) {
  const points = ends.map((end) => look.toScreen(end));
  if (points.every(Boolean)) pen.path(points, style);
}

/** A place that a list tells of: a ring, at the edge with a line from the middle if it lies outside the view. */
export function drawPlace(pen, look, place, { ring: stroke }) {
  const at = look.toScreen(place);
  if (!at) return;
  const { width, height } = look;
  const middle = [width / 2, height / 2];
  const [dx, dy] = [at[0] - middle[0], at[1] - middle[1]];
  const part = Math.min(1, (middle[0] - RING_PX) / Math.abs(dx), (middle[1] - RING_PX) / Math.abs(dy));
  pen.disc([middle[0] + part * dx, middle[1] + part * dy], RING_PX, { stroke, width: 3 });
  if (part < 1) pen.path([middle, [middle[0] + part * dx, middle[1] + part * dy]], { stroke, width: 2, dash: [6, 4] });
}

function ring(pen, look, { at }, style) {
  const middle = look.toScreen(at);
  if (middle) pen.disc(middle, RING_PX, style);
}

function dot(pen, look, at, across, fill, opacity = 1) {
  const middle = look.toScreen(at);
  if (middle) pen.disc(middle, across / 2, { fill, opacity });
}

function label(pen, look, at, words, { text, halo }) {
  const middle = look.toScreen(at);
  if (middle) pen.text([middle[0] + 7, middle[1] - 7], words, { fill: text, halo });
}
