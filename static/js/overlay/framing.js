// What of the world the view shows: the room of a frame, or what lies around the sensor; y up, or the sensor's heading.
// What lies over the view, such as the legend, has its place at the edge, beside the room.

const NORTH_UP = Math.PI / 2; // of the direction in the world that points up on the screen, rad
const MARGIN = 1.08; // around a room that is looked at
const SMALL = 0.6; // of the place there is: a room that fills less than this is looked at again

/**
 * How to look at a room, from and to along x and y (m), with the sensor at a pose, on a sheet {width, height} of pixels
 * with the edges {left, right, top, bottom} taken: the middle and half the height of the view (m), which direction is up
 * (rad), whether that is the sensor's (isTurned) and whether the middle is the sensor (isFollowed).
 */
export function framingOf(extent, { x, y, heading } = { x: 0, y: 0, heading: 0 }, { follow, heading_up: isTurned }, sheet) {
  const up = isTurned ? heading : NORTH_UP;
  const axes = axesAt(up);
  const [across, above] = axes.map((axis) => {
    const [low, high] = [Math.min, Math.max].map((end) => end(...cornersOf(extent).map((corner) => along(axis, corner))));
    const at = follow ? along(axis, [x, y]) : (low + high) / 2;
    return { at, half: Math.max(high - at, at - low) };
  });
  const { left, right, top, bottom, width, height } = sheet;
  const free = [width - left - right, height - top - bottom];
  const scale = Math.min(free[0] / across.half, free[1] / above.half) / (2 * MARGIN); // px/m
  const off = follow ? [0, 0] : [right - left, top - bottom].map((pixels) => pixels / (2 * scale));
  const middle = [0, 1].map((i) => (across.at + off[0]) * axes[0][i] + (above.at + off[1]) * axes[1][i]);
  return { middle, half: height / (2 * scale), up, isTurned, isFollowed: follow };
}

/** Whether all of a room lies in the free part of a sheet, unless the sensor is followed through it, and fills it well. */
export function isFramed(extent, look, { follow }, { left, right, top, bottom, width, height }) {
  const corners = cornersOf(extent).map((corner) => look.toScreen(corner));
  if (!corners.every(Boolean)) return false;
  const free = [[left, width - right], [top, height - bottom]];
  const spans = [0, 1].map((axis) => corners.map((corner) => corner[axis])).map((all) => [Math.min(...all), Math.max(...all)]);
  const isInside = spans.every(([low, high], axis) => low >= free[axis][0] && high <= free[axis][1]);
  return (follow || isInside) && spans.some(([low, high], axis) => high - low > SMALL * (free[axis][1] - free[axis][0]));
}

/** An extent that holds some places, too. */
export const including = (extent, places) =>
  extent.map((ends, axis) => [Math.min, Math.max].map((end, at) => end(ends[at], ...places.map((place) => place[axis]))));

export const cornersOf = ([xs, ys]) => xs.flatMap((x) => ys.map((y) => [x, y]));

/** The directions to the right and up on the screen, where `up` (rad) is up. */
export function axesAt(up) {
  const [c, s] = [Math.cos(up), Math.sin(up)];
  return [[s, -c], [c, s]];
}

export const along = ([u, v], [x, y]) => u * x + v * y;
