// The walls of the map of whole scans, as the stream tells of them about once a second. One may be selected, by its id,
// which stays while the map grows and bends.

import { selectNothing } from "./actions.js";
import { nearestOn } from "./overlay/hits.js";
import { placer } from "./overlay/world.js";
import { get, set } from "./store.js";

const AWAY_M = 0.3; // of a wall of a scan from the wall of the map that it is part of
const ALIGNED = 0.94; // cosine of the turn between them

/** Keeps what the stream tells as "mapped" in the store: {walls, corners}, with their places in metres. */
export function receiveMapped({ walls, corners }) {
  if (!walls.length) set("mappedWall", null); // another map counts from zero again
  set("mapped", {
    walls: walls.map((wall) => ({ ...wall, kind: "mapped", ends: [wall.start, wall.end] })),
    corners,
  });
}

/** Until the stream tells of a map there is none. */
export const noneMapped = () => receiveMapped({ walls: [], corners: [] });

/** Selects a wall of the map by its id, and nothing else. */
export function selectMapped(id) {
  selectNothing();
  set("mappedWall", id);
}

/** The wall of the map that is selected; undefined if none is, or if it has become part of another. */
export const selectedMapped = () => mappedWall(get("mappedWall"));

export const mappedWall = (id) => get("mapped").walls.find((wall) => wall.id === id);

/** Whether the map goes before the scan where both can be meant: while its panel is open. */
export const isMapFirst = () => get("panel") === "map";

/** The wall of the map that a wall of a frame is part of, if it is of one. */
export function mappedOf(frame, wall) {
  const spot = spotOf(frame, wall);
  const near = get("mapped").walls.map((whole) => ({ whole, away: awayFrom(whole, spot) }));
  return near.filter(({ away }) => away < AWAY_M).sort((one, other) => one.away - other.away)[0]?.whole;
}

/** The longest wall of a frame, by its main method, that is part of a wall of the map, if it sees it. */
export function seenOf(frame, whole) {
  const near = (frame.segments[frame.methods[0]] ?? []).filter((wall) => awayFrom(whole, spotOf(frame, wall)) < AWAY_M);
  const seen = near.filter((wall) => mappedOf(frame, wall) === whole); // one beside it may be nearer
  return seen.sort((one, other) => other.length - one.length)[0];
}

/** The middle of a wall of a frame, and in which direction it runs, in the world. */
function spotOf({ localization }, { start, end }) {
  const ends = [start, end].map(placer(localization?.pose));
  return { at: [0, 1].map((axis) => (ends[0][axis] + ends[1][axis]) / 2), runs: direction({ ends }) };
}

/** How far a spot is from a wall, m; Infinity if that runs elsewhere. */
function awayFrom(whole, { at, runs }) {
  const [x, y] = nearestOn(whole.ends, at);
  const isAlong = Math.abs(Math.cos(direction(whole) - runs)) > ALIGNED;
  return isAlong ? Math.hypot(x - at[0], y - at[1]) : Infinity;
}

/** In which direction a wall runs from its first end, which has its free side on the left, rad. */
export const direction = ({ ends: [[x0, y0], [x1, y1]] }) => Math.atan2(y1 - y0, x1 - x0);

/** The same either way, from 0 to pi. */
export const slant = (wall) => (direction(wall) + 2 * Math.PI) % Math.PI;
