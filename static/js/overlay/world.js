// What a frame holds, where it is in the world: corners, walls, rejections and landmarks with their places in metres.

import { isPlaced } from "../pose.js";
import { turned } from "./ellipses.js";

/** Takes [x, y] in the sensor frame to the world, by T_world_sensor. */
export function placer({ x, y, heading } = { x: 0, y: 0, heading: 0 }) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  return ([u, v]) => [x + c * u - s * v, y + s * u + c * v];
}

const NONE = { walls: [], corners: [] };

/** All there is to draw and to point at; `landmarks` are those of the map by their id, `mapped` its walls and corners. */
export function worldOf(frame, landmarks, mapped = NONE) {
  const pose = frame.localization?.pose;
  const place = placer(pose);
  const heading = pose?.heading ?? 0;
  return {
    frame,
    isPlaced: !frame.localization || isPlaced(frame.localization),
    sensor: { at: place([0, 0]), heading },
    corners: frame.corners.map((corner) => cornerOf(corner, place, heading)),
    walls: (frame.segments[frame.methods[0]] ?? []).map((wall) => wallOf(wall, place)),
    rejections: frame.rejections
      .filter(({ xy }) => xy?.every(Number.isFinite))
      .map((rejection) => ({ ...rejection, kind: "rejection", candidate: rejection.kind, at: place(rejection.xy) })),
    landmarks: frame.localization ? [...landmarks.values()].map(landmarkOf) : [],
    tentative: frame.localization?.tentative ?? [],
    mapped: frame.localization ? mapped : NONE,
  };
}

function cornerOf({ id, by_method, segments }, place, heading) {
  const measured = Object.entries(by_method).map(([method, { x, y, covariance, ...rest }]) => ({
    method,
    at: place([x, y]),
    covariance: turned(covariance, heading),
    inSensor: { x, y, ...rest },
  }));
  return { kind: "corner", id, segments, measured, at: measured[0].at };
}

const wallOf = (wall, place) => ({
  ...wall,
  kind: "wall",
  ends: [place(wall.start), place(wall.end)],
});

const landmarkOf = (landmark) => ({
  ...landmark,
  kind: "landmark",
  at: [landmark.x, landmark.y],
  covariance: [
    [landmark.var_x, landmark.cov_xy],
    [landmark.cov_xy, landmark.var_y],
  ],
});
