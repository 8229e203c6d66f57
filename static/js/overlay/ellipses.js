// Ellipses of covariances, in metres and in pixels: large enough to be seen, no larger than the view, side by side.

export const LEAST_PX = 5; // mean half axis on the screen: below it, the mark of the corner would hide the ellipse
export const APART_PX = 3; // between outlines around one corner that would fall on each other
export const SIGMAS = Math.sqrt(-2 * Math.log(1 - 0.95)); // of an ellipse that holds 95 %
const MOST = 0.2; // of the shorter side of the view: several that do not fit leave it open what is under them
const VERTICES = 48;

/** Half axes and direction (rad, of the long one) of the one-sigma ellipse of a covariance. */
export function axesOf([[xx, xy], [, yy]]) {
  const mean = (xx + yy) / 2;
  const apart = Math.hypot((xx - yy) / 2, xy);
  const [long, short] = [mean + apart, mean - apart].map((value) => Math.sqrt(Math.max(value, 0)));
  return { long, short, direction: Math.atan2(2 * xy, xx - yy) / 2 };
}

/** A covariance in a frame that is turned: what `heading` turns, turned back. */
export function turned([[xx, xy], [, yy]], heading) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  const mixed = c * s * (xx - yy) + (c * c - s * s) * xy;
  return [
    [c * c * xx - 2 * c * s * xy + s * s * yy, mixed],
    [mixed, s * s * xx + 2 * c * s * xy + c * c * yy],
  ];
}

/** The places on an ellipse with half axes in the unit of its middle. */
export function outlineOf([x, y], { long, short, direction }) {
  const [c, s] = [Math.cos(direction), Math.sin(direction)];
  return Array.from({ length: VERTICES }, (_, at) => {
    const turn = (2 * Math.PI * at) / VERTICES;
    const [along, across] = [long * Math.cos(turn), short * Math.sin(turn)];
    return [x + c * along - s * across, y + s * along + c * across];
  });
}

/**
 * How ellipses (m) around one corner are drawn in a view: in their order, each with the half axes (m) that are drawn,
 * and `size`: "true", "grown" if it had to be larger to be seen, "shrunk" if it would not fit. Those that nearly coincide
 * keep their order from scan to scan.
 */
export function drawable(ellipses, look) {
  const metre = look.scale; // px
  const most = MOST * Math.min(look.width, look.height);
  const found = new Map();
  let least = LEAST_PX;
  const rank = (ellipse) => Math.round((metre * mean(ellipse)) / APART_PX);
  for (const ellipse of [...ellipses].sort((a, b) => rank(a) - rank(b))) {
    const fitting = Math.min(1, most / (metre * ellipse.long));
    const missing = Math.max(0, least / metre - fitting * mean(ellipse));
    const [long, short] = [ellipse.long, ellipse.short].map((half) => fitting * half + missing);
    const size = fitting < 1 ? "shrunk" : missing > 0 ? "grown" : "true";
    found.set(ellipse, { ...ellipse, long, short, size });
    least = (metre * (long + short)) / 2 + APART_PX;
  }
  return ellipses.map((ellipse) => found.get(ellipse));
}

const mean = ({ long, short }) => (long + short) / 2;
