// How complete the scan is: a ring seen from above as the scene is, with the sectors that were lost on the way.

import { $, setText } from "./dom.js";
import { isStale } from "./live.js";
import { on } from "./store.js";
import { degrees, percent, UNKNOWN } from "./units.js";

const RADIUS = 20;
const TURN = 2 * Math.PI;
const ALMOST_ROUND = 0.999; // of a turn: an arc that ends where it begins would not be drawn

export function mountDial() {
  on(["frame", "source", "connection"], ({ completeness, gaps }, source, connection) => {
    const stale = isStale(source, connection);
    $("dial").toggleAttribute("hidden", !source.live && !gaps?.length);
    $("dial").classList.toggle("stale", stale);
    if ($("dial").hasAttribute("hidden")) return;
    $("dial-lost").setAttribute("d", gaps.map(arc).join(""));
    setText($("dial-text"), stale ? UNKNOWN : percent(completeness));
    $("dial").setAttribute("aria-label", stale ? "No scan arrives" : describe(completeness, gaps));
  });
}

function describe(completeness, gaps) {
  const sectors = gaps.map(([from, to]) => `${degrees(from)} to ${degrees(to)} degrees`);
  return [`Scan complete to ${percent(completeness)}`, ...(sectors.length ? ["lost:"] : []), ...sectors].join(
    " ",
  );
}

/** An arc counter-clockwise from one bearing to the other, forward being to the right. */
function arc([from, to]) {
  const span = Math.min(ALMOST_ROUND * TURN, (((to - from) % TURN) + TURN) % TURN || TURN);
  const end = from + span;
  return `M${point(from)}A${RADIUS} ${RADIUS} 0 ${span > Math.PI ? 1 : 0} 0 ${point(end)}`;
}

const point = (bearing) => [RADIUS * Math.cos(bearing), -RADIUS * Math.sin(bearing)].map((v) => v.toFixed(2));
