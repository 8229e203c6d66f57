// What the pointer is at, in words and numbers, beside it.

import { $, el, remake } from "../dom.js";
import { axesOf } from "./ellipses.js";
import { slant } from "../mapped.js";
import { degrees, duration, fineDegrees, metres, millimetres, moment, wholeNumber } from "../units.js";

const AWAY_PX = 16; // from the pointer

const SAID = {
  corner: cornerSaid, wall: wallSaid, mapped: mappedSaid, landmark: landmarkSaid, rejection: rejectionSaid, beam: beamSaid, pose: poseSaid,
};

/** Says beside a pixel what the things there are. */
export function showHover(things, pixel) {
  const box = $("hover");
  box.hidden = !things.length;
  if (!things.length) return;
  const said = things.map((thing) => SAID[thing.kind](thing));
  remake(box, said, () =>
    said.flatMap(([title, ...lines]) => [el("strong", {}, title), ...lines.map((line) => el("span", {}, line))]),
  );
  const { clientWidth, clientHeight } = $("stage");
  const [x, y] = pixel;
  const left = x + AWAY_PX + box.offsetWidth < clientWidth ? x + AWAY_PX : x - AWAY_PX - box.offsetWidth;
  const top = Math.min(y + AWAY_PX, clientHeight - box.offsetHeight - 4);
  box.style.translate = `${Math.max(4, left)}px ${Math.max(4, top)}px`;
}

function cornerSaid({ id, measured }) {
  const [{ method, inSensor }, ...others] = measured;
  const { x, y, sigma_x, sigma_y, angle } = inSensor;
  return [
    `Corner C${id}`,
    `x ${metres(x)} m ± ${millimetres(sigma_x)} mm`,
    `y ${metres(y)} m ± ${millimetres(sigma_y)} mm`,
    `${degrees(angle)}° between its walls`,
    others.length ? `by ${method} and ${others.length} other methods` : `by ${method}`,
  ];
}

function wallSaid({ id, length, n_points: points, rms, covariance }) {
  return [
    `Wall ${id}`,
    `${metres(length)} m long, ${wholeNumber(points)} points`,
    `distance ± ${millimetres(Math.sqrt(covariance[1][1]))} mm, direction ± ${fineDegrees(Math.sqrt(covariance[0][0]))}°`,
    `points scatter by ${millimetres(rms)} mm`,
  ];
}

function mappedSaid({ id, length, length_variance: variance, ends, covariance, count, first_seen: first }) {
  return [
    `Wall W${id} of the map`,
    `${metres(length)} m ± ${millimetres(Math.sqrt(variance))} mm long, runs at ${degrees(slant({ ends }))}°`,
    `distance ± ${millimetres(Math.sqrt(covariance[1][1]))} mm, direction ± ${fineDegrees(Math.sqrt(covariance[0][0]))}°`,
    `seen in ${wholeNumber(count)} keyframes since ${moment(first)}`,
  ];
}

function landmarkSaid({ id, kind, x, y, covariance, count }) {
  return [
    `Landmark L${id}, ${kind}`,
    `at ${metres(x)}, ${metres(y)} m`,
    `± ${millimetres(axesOf(covariance).long)} mm along the longest axis`,
    `seen ${wholeNumber(count)} times`,
  ];
}

function rejectionSaid({ candidate, reason, message }) {
  return [`Rejected ${candidate}: ${reason}`, message];
}

function beamSaid({ range, bearing }) {
  return ["Beam", `met something at ${metres(range)} m, bearing ${degrees(bearing)}°`];
}

function poseSaid({ age, x, y, heading, sigma_x, sigma_y, sigma_heading }) {
  return [
    `Trail: the sensor ${duration(age)} ago`,
    `x ${metres(x)} m ± ${millimetres(sigma_x)} mm`,
    `y ${metres(y)} m ± ${millimetres(sigma_y)} mm`,
    `heading ${degrees(heading)}° ± ${degrees(sigma_heading)}°`,
  ];
}
