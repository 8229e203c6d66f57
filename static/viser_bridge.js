// Runs in viser's page before viser does: turns its 3D view into a map seen from above, inside our page.
// The parent uses window.lidarView; keys go to the parent, so that its shortcuts work wherever the focus is.

(() => {
  "use strict";
  const NORTH_UP = Math.PI / 2; // azimuth at which y points up on the screen
  const MARGIN = 1.08;
  const SMALL = 0.6; // of the view: a room that fills less than this is looked at again
  const FOLLOW_MS = 1000;
  // viser's own panel and notices have no place here: the page around this one has its own.
  const STYLE = "[data-floating-window], .mantine-Notifications-root, .mantine-Paper-root { display: none !important }";

  let rotating = false;
  let moved = false; // by the user, since the last fit

  // viser only reconnects while its window has the focus, which a frame or a wall display rarely has.
  document.hasFocus = () => !document.hidden;

  const controls = () => window.__viserMutable?.cameraControl;
  const camera = () => window.__viserMutable.camera;
  const slope = () => Math.tan((camera().fov * Math.PI) / 360);
  const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

  /** viser's world (x, y, z up) in the axes of three.js (y up), and its floor back. */
  const inThree = (x, y, z) => [-y, z, -x];
  const onFloor = ({ x, z }) => [-z, -x];

  function applyMode() {
    const view = controls();
    const { ACTION } = view.constructor;
    view.mouseButtons.left = rotating ? ACTION.ROTATE : ACTION.TRUCK;
    view.mouseButtons.right = rotating ? ACTION.TRUCK : ACTION.ROTATE;
    view.touches.one = rotating ? ACTION.TOUCH_ROTATE : ACTION.TOUCH_TRUCK;
    view.dollyToCursor = true;
    view.minPolarAngle = 0;
    view.maxPolarAngle = rotating ? 0.48 * Math.PI : 0;
    view.minAzimuthAngle = rotating ? -Infinity : NORTH_UP;
    view.maxAzimuthAngle = rotating ? Infinity : NORTH_UP;
  }

  /** Rotation by dragging, or a map that only pans and zooms; back on the map, the room is fitted again. */
  async function setRotate(wanted) {
    if (wanted === rotating) return;
    rotating = wanted;
    await ready;
    applyMode();
    if (!rotating) await fit();
  }

  /** Look down on all of the newest scan. */
  async function fit() {
    const room = await measure();
    if (!room) return;
    lookDownOn(room);
    moved = false;
  }

  /** Until the user moves the view, keep the room in it. */
  async function follow() {
    const room = moved || rotating || document.hidden ? null : await measure();
    if (room && !isInView(room)) lookDownOn(room);
  }

  /** Centre and half width of the newest scan along x and y; null while there is none. */
  async function measure() {
    await ready;
    const health = await ask("health");
    const frame = health?.ready ? await ask("frame?points=true") : null;
    return frame && [0, 1].map((axis) => span(frame.points.map((point) => point[axis])));
  }

  async function ask(path) {
    const answer = await fetch(`../api/v1/${path}`).catch(() => null);
    return answer?.ok ? answer.json() : null;
  }

  /** The sensor included, a few stray points not. */
  function span(values) {
    values.sort((a, b) => a - b);
    const stray = Math.floor(values.length / 300);
    const low = Math.min(-0.5, values[stray] ?? 0);
    const high = Math.max(0.5, values[values.length - 1 - stray] ?? 0);
    return { centre: (low + high) / 2, half: (high - low) / 2 };
  }

  function lookDownOn([x, y]) {
    const height = (MARGIN * Math.max(y.half, x.half / camera().aspect)) / slope();
    const eye = inThree(x.centre, y.centre - 1e-5 * height, height);
    controls().setLookAt(...eye, ...inThree(x.centre, y.centre, 0), true);
  }

  function isInView(room) {
    const middle = onFloor(controls().getTarget());
    const half = controls().distance * slope();
    const halves = [half * camera().aspect, half];
    const inside = room.every(({ centre, half }, i) => Math.abs(centre - middle[i]) + half < halves[i]);
    return inside && room.some(({ half }, i) => half > SMALL * halves[i]);
  }

  function forwardKey(event) {
    event.stopImmediatePropagation(); // viser would fly through the scene
    const { key, code, altKey, ctrlKey, metaKey, shiftKey } = event;
    const message = { type: "keydown", key, code, altKey, ctrlKey, metaKey, shiftKey };
    if (window.parent !== window) window.parent.postMessage(message, location.origin);
  }

  async function start() {
    while (!controls() || !camera()) await pause(50);
    applyMode();
  }

  async function keepFollowing() {
    await ready;
    for (;;) {
      await follow();
      await pause(FOLLOW_MS);
    }
  }

  const style = document.createElement("style");
  style.textContent = STYLE;
  document.head.append(style);
  window.addEventListener("keydown", forwardKey, true);
  for (const gesture of ["pointerdown", "wheel"]) {
    window.addEventListener(gesture, () => (moved = true), { capture: true, passive: true });
  }
  const ready = start();
  window.lidarView = { setRotate, fit };
  keepFollowing();
})();
