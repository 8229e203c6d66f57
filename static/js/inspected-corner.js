// What the inspector says of the selected corner.

import { placer } from "./overlay/world.js";
import { sightedAt } from "./scatter.js";
import { selectWall } from "./selected-wall.js";
import { get } from "./store.js";
import { degrees, metres, millimetres, squareMillimetres } from "./units.js";

/** The selected corner of a frame as the inspector shows things; undefined if there is none. */
export function inspectedCorner(frame) {
  const corner = frame.corners.find(({ id }) => id === get("selection")?.corner);
  if (!corner) return undefined;
  const { id, by_method: measured } = corner;
  const methods = frame.methods.filter((name) => measured[name]);
  const { x, y } = measured[methods[0]];
  return {
    key: id,
    name: `Corner C${id}`,
    at: placer(frame.localization?.pose)([x, y]),
    methods,
    facts: factsOf(measured[methods[0]]),
    rows: [],
    ways: waysTo(frame, corner, methods[0]),
    sighted: get("repeatability") && sightedAt(get("repeatability"), [x, y]),
    deviations: get("deviations"),
    claims: methods.map((method) => ({
      method,
      kind: frame.covariance,
      covariance: measured[method].covariance,
      offset: [measured[method].x - x, measured[method].y - y],
    })),
    axes: "x to the right, y up, mm",
  };
}

const factsOf = ({ x, y, sigma_x, sigma_y, angle, area }) => [
  ["x", `${metres(x)}\u2009m ± ${millimetres(sigma_x)}\u2009mm`],
  ["y", `${metres(y)}\u2009m ± ${millimetres(sigma_y)}\u2009mm`],
  ["1σ area", `${squareMillimetres(area)}\u2009mm²`],
  ["Angle", `${degrees(angle)}°`],
];

/** To the walls that it is made of. */
function waysTo(frame, { segments }, method) {
  const walls = segments.map((id) => frame.segments[method].find((wall) => wall.id === id)).filter(Boolean);
  return walls.map((wall) => [`Wall ${wall.id}, ${metres(wall.length)}\u2009m`, () => selectWall(frame, wall)]);
}
