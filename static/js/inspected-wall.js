// What the inspector says of the selected wall.

import { select } from "./actions.js";
import { request } from "./api.js";
import { mappedOf, selectMapped } from "./mapped.js";
import { placer } from "./overlay/world.js";
import { sightedWall } from "./scatter.js";
import { mountSelectedWall, selectedWall } from "./selected-wall.js";
import { get, on, set } from "./store.js";
import { throttled } from "./throttle.js";
import { fineDegrees, metres, millimetres, wholeNumber } from "./units.js";

const MEASURED_MS = 500;

export function mountInspectedWall() {
  mountSelectedWall();
  const measure = throttled(MEASURED_MS, measureLength);
  on(["wall"], () => set("length", null));
  on(["frame", "wall"], (frame, wall) => wall && measure());
}

/** The selected wall of a frame as the inspector shows things; undefined if there is none. */
export function inspectedWall(frame) {
  const wall = selectedWall(frame);
  if (!wall) return undefined;
  const seen = frame.methods.map((method) => ({ method, ...selectedWall(frame, method) })).filter(({ start }) => start);
  return {
    key: get("wall"),
    name: "Wall",
    at: placer(frame.localization?.pose)([0, 1].map((axis) => (wall.start[axis] + wall.end[axis]) / 2)),
    methods: seen.map(({ method }) => method),
    facts: factsOf(frame, wall),
    rows: seen.map(rowOf),
    ways: [...cornersOf(frame, wall).map(({ id }) => [`Corner C${id}`, () => select({ corner: id })]), ...wayToMap(frame, wall)],
    sighted: get("repeatability") && sightedWall(get("repeatability"), wall, frame),
    deviations: get("wallDeviations"),
    claims: seen.map(({ method, alpha, r, covariance }) => ({
      method,
      kind: frame.covariance,
      covariance,
      offset: [turn(alpha - wall.alpha), r - wall.r],
    })),
    axes: "α to the right, mrad, r up, mm",
  };
}

const factsOf = (frame, wall) => [
  ["Length", `${metres(wall.length)}\u2009m`],
  ["Points", wholeNumber(wall.n_points)],
  ["Scatter", `${millimetres(wall.rms)}\u2009mm`],
  ["Covariance", frame.covariance],
  ["Corner to corner", lengthText(cornersOf(frame, wall).length)],
];

/** The length is as sure as the corners at its ends; an end that is no corner is where the last beam happened to be. */
function lengthText(corners) {
  if (corners < 2) return corners ? "only one end is a corner" : "neither end is a corner";
  const found = get("length");
  return found ? `${metres(found.distance)}\u2009m ± ${millimetres(found.sigma)}\u2009mm` : "being measured";
}

const rowOf = ({ method, alpha, r, covariance: [[alphas], [, rs]] }) => [
  method,
  [fineDegrees(alpha), fineDegrees(Math.sqrt(alphas)), metres(r), millimetres(Math.sqrt(rs))],
];

/** The corners at the ends of a wall of the main method. */
const cornersOf = ({ corners, methods: [main] }, { id }) =>
  corners.filter(({ segments, by_method: measured }) => measured[main] && segments.includes(id));

/** To the wall of the map that it is part of. */
function wayToMap(frame, wall) {
  const whole = mappedOf(frame, wall);
  return whole ? [[`Wall W${whole.id} of the map`, () => selectMapped(whole.id)]] : [];
}

/** Asks how far the corners of the selected wall are from each other, and how sure. */
async function measureLength() {
  const frame = get("frame");
  const wall = selectedWall(frame);
  const ends = wall ? cornersOf(frame, wall) : [];
  if (ends.length < 2) return;
  const place = placer(frame.localization?.pose);
  const [first, second] = ends.map(({ by_method: measured }) => {
    const { x, y } = measured[frame.methods[0]];
    return `corner@${place([x, y]).map((value) => value.toFixed(4))}`;
  });
  const found = await request("GET", `measure?first=${first}&second=${second}`).catch(() => null); // the scan may be gone by now
  if (found) set("length", found);
}

const turn = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
