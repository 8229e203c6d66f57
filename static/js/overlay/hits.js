// What lies under the pointer.

export const MOUSE_PX = 10;
export const FINGER_PX = 24;
const WALL_PX = 6;
const SPECK_PX = 4;

/** The thing of a world that is nearest to a pixel and near enough; marks go before walls, which are large. Else null. */
export function thingAt(world, layers, look, pixel, within = MOUSE_PX) {
  return nearestMark(marksOf(world, layers), look, pixel, within) ?? nearestWall(world, layers, look, pixel);
}

/** The measured point or, beside all of them, the point of the trail at a pixel, of those `around`; else null. */
export function speckAt({ beams, poses }, layers, look, pixel) {
  const beam = layers.points && nearestMark(beams, look, pixel, SPECK_PX);
  return beam || (layers.trail && nearestMark(poses, look, pixel, SPECK_PX)) || null;
}

/** The corner and the landmark at a pixel: a landmark and the corner taken for it lie on each other, so a click means both. */
export function chosenAt(world, layers, look, pixel, within) {
  const nearest = (kind) => nearestMark(marksOf(world, layers).filter((mark) => mark.kind === kind), look, pixel, within);
  return { corner: nearest("corner")?.id, landmark: nearest("landmark")?.id };
}

/** The corner or wall at a pixel, and the place on it: what can be measured from. Else null. */
export function measurableAt(world, look, pixel, within) {
  const corner = nearestMark(world.corners, look, pixel, within);
  if (corner) return { kind: "corner", at: corner.at };
  const wall = nearestWall(world, { segments: true }, look, pixel, within);
  return wall && { kind: "wall", at: nearestOn(wall.ends, look.toFloor(pixel)) };
}

/** The place on a stretch between two ends that is nearest to a place. */
export function nearestOn([[x0, y0], [x1, y1]], [x, y]) {
  const [dx, dy] = [x1 - x0, y1 - y0];
  const part = Math.min(1, Math.max(0, ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1)));
  return [x0 + part * dx, y0 + part * dy];
}

const marksOf = ({ corners, landmarks, rejections }, layers) => [
  ...(layers.corners || layers.ellipses ? corners : []),
  ...(layers.landmarks ? landmarks : []),
  ...(layers.rejected ? rejections : []),
];

function nearestMark(marks, look, pixel, within) {
  let best = null;
  let least = within;
  for (const mark of marks) {
    const at = look.toScreen(mark.at);
    const way = at ? Math.hypot(at[0] - pixel[0], at[1] - pixel[1]) : Infinity;
    if (way < least) [best, least] = [mark, way];
  }
  return best;
}

/** The wall at a pixel, if walls are shown; else null. */
export function nearestWall({ walls }, layers, look, pixel, within = WALL_PX) {
  if (!layers.segments) return null;
  let best = null;
  let least = within;
  for (const wall of walls) {
    const [a, b] = wall.ends.map((end) => look.toScreen(end));
    const way = a && b ? distanceTo(pixel, a, b) : Infinity;
    if (way < least) [best, least] = [wall, way];
  }
  return best;
}

/** From a point to a stretch from one point to another. */
function distanceTo(point, ...ends) {
  const [x, y] = nearestOn(ends, point);
  return Math.hypot(point[0] - x, point[1] - y);
}
