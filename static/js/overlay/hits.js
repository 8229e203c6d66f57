// What lies under the pointer.

export const MOUSE_PX = 10;
export const FINGER_PX = 24;
const WALL_PX = 6;
const SPECK_PX = 4;

/** What of a world is at a pixel, or near enough: a mark, else walls, which are large. */
export function thingsAt(world, layers, look, pixel, within = MOUSE_PX) {
  const mark = nearestMark(marksOf(world, layers), look, pixel, within);
  return mark ? [mark] : wallsAt(world, layers, look, pixel);
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

/** What can be measured from at a pixel: {scan, map}, in each {kind, at} of a corner or wall, or null. */
export function measurableAt(world, look, pixel, within) {
  const of = ({ corners, walls }, prefix) => {
    const corner = nearestMark(corners, look, pixel, within);
    if (corner) return { kind: `${prefix}corner`, at: corner.at };
    const wall = nearestWall(walls, look, pixel, within);
    return wall && { kind: `${prefix}wall`, at: nearestOn(wall.ends, look.toFloor(pixel)) };
  };
  return { scan: of(world, ""), map: of(world.mapped, "map-") };
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

/** The walls at a pixel, of those that are shown: the scan's, and the map's, which lies below it. */
export function wallsAt({ walls, mapped }, layers, look, pixel, within) {
  const shown = [layers.segments ? walls : [], layers.walls ? mapped.walls : []];
  return shown.map((some) => nearestWall(some, look, pixel, within)).filter(Boolean);
}

function nearestWall(walls, look, pixel, within = WALL_PX) {
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
