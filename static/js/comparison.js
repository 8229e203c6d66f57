// What stands beside the estimate of the pose: speed, consistency, odometry alone, and the truth where there is one.

import { errorOf, positionSigma } from "./pose.js";
import { DEGREE, degrees, fixed, spread } from "./units.js";

/** Lines of [label, text, hint] beside the estimate. */
export function comparison(now) {
  const {
    velocity,
    sideways,
    dead_reckoned: reckoned,
    truth,
    nis,
    dof,
    nis_band: [low, high],
  } = now;
  const error = errorOf(now);
  return [
    velocity && [
      "Speed",
      `${fixed(Math.hypot(velocity[0], sideways), 2)}\u2009m/s, ${degrees(velocity[1])}°/s`,
      "Estimated, in whatever direction, with the turn rate",
    ],
    dof && [
      "NIS",
      `${fixed(nis, 1)} of ${dof}, 95 %: ${fixed(low, 0)} to ${fixed(high, 0)}`,
      "Normalized innovation squared, and the interval that holds 95 % of its values if the filter is consistent",
    ],
    reckoned && [
      "Odometry only",
      poseText(reckoned),
      "The pose from odometry alone, or from the poses that a corrected log has in its place",
    ],
    truth && ["True pose", poseText({ x: truth[0], y: truth[1], heading: truth[2] }), "From the simulator or a reference system"],
    error && [
      "Error",
      errorText(error, now),
      "Distance from the true pose, and the standard deviation along the longest axis",
    ],
  ].filter(Boolean);
}

const poseText = ({ x, y, heading }) =>
  `${fixed(x, 3)}, ${fixed(y, 3)}\u2009m${heading === null ? "" : `, ${degrees(heading)}°`}`;

function errorText({ distance, heading }, now) {
  const turn = heading === null ? "" : `, ${fixed(heading / DEGREE, 2)}°`;
  return `${spread(distance)} (1σ ${spread(positionSigma(now))})${turn}`;
}
