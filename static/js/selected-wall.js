// The selected wall. Each scan numbers its walls anew, so it is known by where it lies: the wall of the next scan there.

import { selectNothing } from "./actions.js";
import { nearestOn } from "./overlay/hits.js";
import { placer } from "./overlay/world.js";
import { get, on, set } from "./store.js";

const AWAY_M = 0.3;
const ALIGNED = 0.94; // cosine of the turn to a wall that may be the same

export function mountSelectedWall() {
  on(["frame", "wall"], (frame, wall) => {
    const now = wall && selectedWall(frame);
    if (now) Object.assign(wall, spotOf(frame, now)); // a wall that hides comes back where it was
  });
}

/** Selects a wall of the main method in a frame, and nothing else. */
export function selectWall(frame, wall) {
  selectNothing();
  set("wall", spotOf(frame, wall));
}

/** The wall that is selected, as a method (the main one, if none is named) sees it in a frame; undefined if it does not. */
export function selectedWall(frame, method = frame.methods[0]) {
  const spot = get("wall");
  if (!spot) return undefined;
  const place = placer(frame.localization?.pose);
  const near = (frame.segments[method] ?? [])
    .map((wall) => ({ wall, away: distance(spot.at, nearestOn([wall.start, wall.end].map(place), spot.at)) }))
    .filter(({ wall, away }) => away < AWAY_M && Math.cos(spotOf(frame, wall).direction - spot.direction) > ALIGNED);
  return near.sort((a, b) => a.away - b.away)[0]?.wall;
}

/** The middle of a wall, and where it faces, in the world. */
function spotOf({ localization }, { alpha, start, end }) {
  const pose = localization?.pose;
  const middle = [0, 1].map((axis) => (start[axis] + end[axis]) / 2);
  return { at: placer(pose)(middle), direction: alpha + (pose?.heading ?? 0) };
}

const distance = ([x0, y0], [x1, y1]) => Math.hypot(x1 - x0, y1 - y0);
