// What the inspector says of the selected wall of the map, and how it became so.

import { request } from "./api.js";
import { earlierFigure } from "./earlier.js";
import { direction, mappedWall, seenOf, selectedMapped, selectMapped, slant } from "./mapped.js";
import { selectWall } from "./selected-wall.js";
import { get, on, set } from "./store.js";
import { throttled } from "./throttle.js";
import { degrees, fineDegrees, metres, millimetres, moment, wholeNumber } from "./units.js";

const REFRESH_MS = 2000;
const LONGEST_S = 900; // of the history that is shown

export function mountInspectedMapped() {
  const ask = throttled(REFRESH_MS, askHistory);
  on(["mappedWall"], () => set("wallHistory", []));
  on(["mapped", "mappedWall"], (_, id) => id !== null && ask());
}

/** The selected wall of the map as the inspector shows things; undefined if there is none. */
export function inspectedMapped(frame) {
  const wall = selectedMapped();
  if (!wall) return undefined;
  return {
    key: `mapped ${wall.id}`,
    name: `Wall W${wall.id} of the map`,
    at: middleOf(wall),
    facts: factsOf(wall),
    rows: [],
    ways: [...waysAround(wall), ...wayToScan(frame, wall)],
    history: get("wallHistory"),
    figure: () => historyOf(wall, get("wallHistory")),
  };
}

function factsOf(wall) {
  const { alpha, r, length, length_variance: variance, covariance, count, first_seen: first, last_seen: last } = wall;
  const [[alphas], [, rs]] = covariance;
  return [
    ["Length", `${metres(length)}\u2009m ± ${millimetres(Math.sqrt(variance))}\u2009mm`],
    ["Runs at", `${degrees(slant(wall))}°`],
    ["α", `${fineDegrees(alpha)}° ± ${fineDegrees(Math.sqrt(alphas))}°`],
    ["r", `${metres(r)}\u2009m ± ${millimetres(Math.sqrt(rs))}\u2009mm`],
    ["From", endText(wall, 0)],
    ["To", endText(wall, 1)],
    ["Seen", `in ${wholeNumber(count)} keyframes, ${moment(first)} to ${moment(last)}`],
  ];
}

/** Where an end is, and whether it is one. */
function endText({ ends, ended, in_corner: inCorner }, at) {
  const what = inCorner[at] ? "a corner" : ended[at] ? "its end" : "may go on";
  return `${ends[at].map(metres).join(", ")}\u2009m, ${what}`;
}

/** To the walls that it meets in corners. */
function waysAround({ id }) {
  const met = get("mapped").corners.filter(({ walls }) => walls.includes(id));
  const others = met.flatMap(({ walls }) => walls.filter((other) => other !== id));
  return others.map(mappedWall).map((wall) => [`Wall W${wall.id}, ${metres(wall.length)}\u2009m`, () => selectMapped(wall.id)]);
}

/** To what the scan sees of it. */
function wayToScan(frame, wall) {
  const seen = seenOf(frame, wall);
  return seen ? [["In this scan", () => selectWall(frame, seen)]] : [];
}

/** Asks for the history of the selected wall, anew while it changes. */
async function askHistory() {
  const wall = selectedMapped();
  if (!wall || get("wallHistory").at(-1)?.last_seen === wall.last_seen) return;
  const query = `walls/${wall.id}/history?limit=1000&after=${wall.last_seen - LONGEST_S}`;
  const found = await request("GET", query).catch(() => null); // the wall may have become part of another
  if (found && get("mappedWall") === wall.id) set("wallHistory", found.history);
}

/** How far across the wall it was, at the middle of where it is now, and how much longer. */
function historyOf(wall, states) {
  const [x, y] = middleOf(wall);
  const free = direction(wall) + Math.PI / 2; // where its free side is
  const across = ({ alpha, r }) => Math.sign(Math.cos(alpha - free)) * (r - x * Math.cos(alpha) - y * Math.sin(alpha));
  return earlierFigure({
    title: "Earlier place and length relative to now, mm",
    states,
    scale: "outlying", // the length by which a wall grows is far larger than what the place varies by
    lines: [
      { label: "length", key: "across", tone: "--across", of: ({ length }) => length - wall.length },
      { label: "place", key: "along", tone: "--along", of: across },
    ],
    sigma: ({ alpha, covariance: [[alphas, mixed], [, rs]] }) => {
      const slope = y * Math.cos(alpha) - x * Math.sin(alpha); // of the place, by alpha
      return Math.sqrt(Math.max(0, slope * slope * alphas - 2 * slope * mixed + rs));
    },
  });
}

const middleOf = ({ ends: [[x0, y0], [x1, y1]] }) => [(x0 + x1) / 2, (y0 + y1) / 2];
