// What of the world the view shows: the room of a frame, or what lies around the sensor; y up, or the sensor's heading.

const NORTH_UP = Math.PI / 2; // of the direction in the world that points up on the screen, rad

/**
 * What to look at: its centre (m, world), half of what there is to the right and up from there (m), which direction is up
 * (rad), and whether that is the sensor's (isTurned) and the centre is the sensor (isFollowed).
 */
export function framingOf(extent, { x, y, heading } = { x: 0, y: 0, heading: 0 }, { follow, heading_up: isTurned }) {
  const up = isTurned ? heading : NORTH_UP;
  const axes = axesAt(up);
  const corners = extent[0].flatMap((x) => extent[1].map((y) => [x, y]));
  const [right, above] = axes.map((axis) => {
    const [low, high] = [Math.min, Math.max].map((end) => end(...corners.map((corner) => along(axis, corner))));
    const at = follow ? along(axis, [x, y]) : (low + high) / 2;
    return { at, half: Math.max(high - at, at - low) };
  });
  const centre = [0, 1].map((i) => right.at * axes[0][i] + above.at * axes[1][i]);
  return { centre, halves: [right.half, above.half], up, isTurned, isFollowed: follow };
}

/** The directions to the right and up on the screen, where `up` (rad) is up. */
export function axesAt(up) {
  const [c, s] = [Math.cos(up), Math.sin(up)];
  return [[s, -c], [c, s]];
}

export const along = ([u, v], [x, y]) => u * x + v * y;
