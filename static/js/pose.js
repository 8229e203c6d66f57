// A pose of the filter in figures: how sure it is, and how far it is from the truth where that is known.

/** Standard deviation along the longest axis of the ellipse of a covariance, in metres. */
export function longestSigma({ var_x: xx, cov_xy: xy, var_y: yy }) {
  return Math.sqrt((xx + yy) / 2 + Math.hypot((xx - yy) / 2, xy));
}

export const positionSigma = ({ covariance: [[xx, xy], [, yy]] }) =>
  longestSigma({ var_x: xx, cov_xy: xy, var_y: yy });

/** How far the estimate is from the truth, {distance, heading}; heading null where only the position is known. */
export function errorOf({ pose, truth }) {
  if (!truth) return null;
  const [x, y, heading] = truth;
  const turn = heading === null ? null : Math.abs(wrapped(pose.heading - heading));
  return { distance: Math.hypot(pose.x - x, pose.y - y), heading: turn };
}

/** Whether whole scans tell the pose: they make a map, or are matched to the grid of one. */
export const isOfScans = ({ mode, method }, localization) =>
  mode === "slam" ? method === "scans" : mode === "localize" && localization.method === "scans";

/** Whether a known map is still searched for the first time: the pose says nothing then. */
export const isSought = ({ mode, state }) => mode === "localize" && state === "starting";

/** Whether what is seen lies at the pose: in a known map it does not until it is found there, nor when lost. */
export const isPlaced = ({ mode, state }) => mode === "slam" || !["starting", "lost"].includes(state);

/** An angle in -π to π. */
export const wrapped = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
