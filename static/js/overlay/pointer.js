// Clicks and hovers over the scene, which takes the pointer itself to be dragged and zoomed.

import { FINGER_PX, MOUSE_PX } from "./hits.js";

const STILL_PX = { mouse: 4, pen: 6, touch: 10 }; // a pointer that moves less while it is pressed has clicked
const ZOOM = 0.0015; // of a pixel of the wheel, in the logarithm

/**
 * Listens in a window or element where pixels count from the corner of the view: `click(pixel, within)` and
 * `hover(pixel or null)`. A `camera`, if one is wanted here, is dragged and zoomed.
 */
export function listen(target, { click, hover, camera }) {
  let pressed = null; // where, and whether it has been dragged since

  target.addEventListener("pointerdown", (event) => {
    pressed = event.isPrimary && event.button === 0 && isScene(event.target) ? { from: at(event), last: at(event) } : null;
  }, true);
  target.addEventListener("pointermove", (event) => {
    if (!pressed) return void (isScene(event.target) && hover(event.pointerType === "touch" ? null : at(event)));
    const now = at(event);
    if (distance(now, pressed.from) > STILL_PX[event.pointerType]) pressed.dragged = true;
    if (pressed.dragged) camera()?.drag(now[0] - pressed.last[0], now[1] - pressed.last[1]);
    pressed.last = now;
  }, true);
  target.addEventListener("pointerup", (event) => {
    if (pressed && !pressed.dragged) click(at(event), event.pointerType === "touch" ? FINGER_PX : MOUSE_PX);
    pressed = null;
  }, true);
  target.addEventListener("pointercancel", () => (pressed = null), true);
  target.addEventListener("pointerout", ({ relatedTarget }) => relatedTarget || hover(null), true);
  target.addEventListener("wheel", (event) => camera()?.zoom(at(event), Math.exp(-ZOOM * event.deltaY)), { passive: true });
}

const at = ({ clientX, clientY }) => [clientX, clientY];
const distance = ([x0, y0], [x1, y1]) => Math.hypot(x1 - x0, y1 - y0);

/** Not the sheet on which a pose is dragged. */
const isScene = (target) => !target?.closest?.(".pose-catcher");
