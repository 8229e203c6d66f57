// Runs in viser's page before viser does: turns its 3D view into a map seen from above, inside our page.
// The parent uses window.lidarView, says for each frame what to look at (overlay/framing.js), and asks how the floor lies
// in the window, to draw over it; it is sent the keys, so that its shortcuts work wherever the focus is, {type: "dragged"}
// when someone drags the view, and the pose that someone drags: {type: "pose", x, y, heading} in the world, m and rad.

(() => {
  "use strict";
  const CLICK_PX = 4; // a pointer that moves less while it is pressed
  const SHORT_DRAG = 12; // px; shorter ones have no direction
  const POINT_PX = 3; // of the measured points, at every zoom
  const POINTS = ["/body/points", "/body/rejected/points"];
  // viser's own panel and notices have no place here: the page around this one has its own.
  const STYLE = `
    [data-floating-window], .mantine-Notifications-root, .mantine-Paper-root { display: none !important }
    .pose-catcher { position: fixed; inset: 0; z-index: 1000; cursor: crosshair; touch-action: none }
    .pose-catcher svg { width: 100%; height: 100%; fill: none; stroke: #ffe14d; stroke-width: 3 }
    .pose-catcher .halo { stroke: #14171a; stroke-width: 6 }`;

  let wanted = null; // what the newest frame shows, as framing.js has it
  let rotating = false;
  let moved = false; // by the user, since the last fit
  let pressed = null; // where the pointer went down last
  let fingers = 0; // or other pointers that are down
  let placing = null; // what takes the drag of a pose

  // A part of viser asks for eval, which the policy refuses, and viser does without: no fault to report.
  addEventListener("unhandledrejection", (event) => event.reason instanceof EvalError && event.preventDefault());

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
    if (wanted) turn();
  }

  /** Which way is up: as wanted, or as it was rotated. */
  function turn() {
    const view = controls();
    const isFree = rotating && !wanted.isTurned;
    const way = wanted.up - view.azimuthAngle;
    const azimuth = view.azimuthAngle + Math.atan2(Math.sin(way), Math.cos(way)); // no whole turns
    limit("minAzimuthAngle", isFree ? -Infinity : azimuth);
    limit("maxAzimuthAngle", isFree ? Infinity : azimuth);
    if (!isFree && Math.abs(azimuth - view.azimuthAngle) > 1e-6) view.rotateTo(azimuth, view.polarAngle, false);
  }

  /** Sets a limit of the camera; to set what it is already would draw the scene once more. */
  function limit(name, value) {
    const view = controls();
    const isThere = view[name] === value || Math.abs(view[name] - value) < 1e-9;
    if (!isThere) view[name] = value;
  }

  /** Rotation by dragging, or a map that only pans and zooms; back on the map, the room is fitted again. */
  async function setRotate(wanted) {
    if (wanted === rotating) return;
    rotating = wanted;
    await ready;
    applyMode();
    if (!rotating) await fit();
  }

  /** Look down on all that is to be seen, else on that of the newest frame. */
  async function fit(framing = wanted) {
    wanted = framing;
    await ready;
    if (!wanted) return;
    lookDown();
    moved = false;
  }

  /** Look at a new frame; until the user moves the view, all of it is kept in it. */
  async function look(framing) {
    wanted = framing;
    await ready;
    if (placing || document.hidden) return;
    turn();
    if (wanted.isFollowed) controls().moveTo(...inThree(...wanted.middle, 0), false);
    if (!moved && !rotating && !wanted.isFramed) lookDown();
  }

  function lookDown() {
    const { middle: [x, y], half, up } = wanted;
    const height = half / slope();
    const [back, aside] = [1e-5 * height * Math.cos(up), 1e-5 * height * Math.sin(up)];
    controls().setLookAt(...inThree(x - back, y - aside, height), ...inThree(x, y, 0), true);
  }

  /** Whether the next drag says where the sensor is and where it looks. */
  function setPlacing(wanted) {
    placing?.remove();
    placing = wanted ? poseCatcher() : null;
    if (placing) document.body.append(placing);
  }

  /** A sheet over the scene: pressed where the sensor is, dragged to where it looks. */
  function poseCatcher() {
    const sheet = document.createElement("div");
    sheet.className = "pose-catcher";
    sheet.innerHTML = '<svg><path class="halo"/><path/></svg>';
    let start = null;
    const length = ({ clientX, clientY }) => Math.hypot(clientX - start.clientX, clientY - start.clientY);
    const draw = (path) => sheet.querySelectorAll("path").forEach((line) => line.setAttribute("d", path));
    sheet.addEventListener("pointerdown", (event) => {
      if (start || event.button !== 0) return;
      start = event;
      sheet.setPointerCapture(event.pointerId);
      draw(arrow(start, start));
    });
    sheet.addEventListener("pointermove", (event) => {
      if (start?.pointerId === event.pointerId) draw(arrow(start, event));
    });
    sheet.addEventListener("pointerup", (event) => {
      if (start?.pointerId !== event.pointerId) return;
      if (length(event) >= SHORT_DRAG) tell(poseOf(start, event));
      start = null;
      draw("");
    });
    sheet.addEventListener("pointercancel", () => {
      start = null;
      draw("");
    });
    return sheet;
  }

  /** A dot, and an arrow from it once it has a length. */
  function arrow({ clientX: x0, clientY: y0 }, { clientX: x1, clientY: y1 }) {
    const dot = `M${x0 - 5} ${y0}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0`;
    if (Math.hypot(x1 - x0, y1 - y0) < SHORT_DRAG) return dot;
    const along = Math.atan2(y1 - y0, x1 - x0);
    const barb = (side) => `${x1 - 14 * Math.cos(along + side)} ${y1 - 14 * Math.sin(along + side)}`;
    return `${dot}M${x0} ${y0}L${x1} ${y1}M${barb(0.5)}L${x1} ${y1}L${barb(-0.5)}`;
  }

  function poseOf(start, end) {
    const [[x, y], [toX, toY]] = [start, end].map(floorAt);
    return { type: "pose", x, y, heading: Math.atan2(toY - y, toX - x) };
  }

  let box = null; // of the canvas in the window; to measure it at every look would take longer than all the rest

  function canvasBox() {
    const canvas = document.querySelector("canvas");
    if (!box) new ResizeObserver(() => (box = canvas.getBoundingClientRect())).observe(canvas);
    return (box ??= canvas.getBoundingClientRect());
  }

  /** Where the ray through a point of the window meets the floor. */
  function floorAt({ clientX, clientY }) {
    const eye = camera().position;
    const { left, top, width, height } = canvasBox();
    const [right, up] = [(2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height];
    const beam = eye.clone().set(right, up, 0.5).unproject(camera()).sub(eye);
    return onFloor(eye.clone().addScaledVector(beam, -eye.y / beam.y));
  }

  /** Whether the pointer drags the view; a click that selects something does not. */
  function isDrag({ buttons, clientX, clientY }) {
    if (!buttons || !pressed || placing) return false;
    return Math.hypot(clientX - pressed.clientX, clientY - pressed.clientY) > CLICK_PX;
  }

  function drag(event) {
    if (!isDrag(event)) return;
    moved = true;
    if (fingers < 2) tell({ type: "dragged" });
  }

  function tell(message) {
    if (window.parent !== window) window.parent.postMessage(message, location.origin);
  }

  function forwardKey(event) {
    event.stopImmediatePropagation(); // viser would fly through the scene
    const { key, code, altKey, ctrlKey, metaKey, shiftKey } = event;
    tell({ type: "keydown", key, code, altKey, ctrlKey, metaKey, shiftKey });
  }

  let hidden = []; // names of viser's nodes

  /** Show all nodes but these, in this browser only. */
  function hide(names) {
    if (`${names}` === `${hidden}`) return;
    hidden = names;
    window.__viserMutable?.requestRender();
  }

  /** A node holds its children, the root all of them. */
  function applyHidden() {
    const { nodeRefFromName } = window.__viserMutable;
    nodeRefFromName[""]?.traverse(({ layers }) => layers.set(0)); // of three.js: the first is drawn
    for (const [name, node] of Object.entries(nodeRefFromName)) {
      if (hidden.some((one) => name.startsWith(one))) node?.traverse(({ layers }) => layers.disableAll());
    }
  }

  /** The homography from the floor (x, y, 1) to pixels of the window, row by row; null until there is a view. */
  function floorToWindow() {
    if (!controls() || !camera()) return null;
    const { left, top, width, height } = canvasBox();
    camera().updateMatrixWorld();
    const m = camera().projectionMatrix.clone().multiply(camera().matrixWorldInverse).elements;
    const [right, up, , depth] = [0, 1, 2, 3].map((i) => [-m[8 + i], -m[i], m[12 + i]]); // of x, y and 1
    return [
      ...depth.map((d, k) => (left + width / 2) * d + (width / 2) * right[k]),
      ...depth.map((d, k) => (top + height / 2) * d - (height / 2) * up[k]),
      ...depth,
    ];
  }

  let looked = () => {};

  /** Calls `run` whenever the camera has moved, before the scene is drawn from there. */
  const onLook = (run) => (looked = run);

  /** Points have a size of the screen; viser knows only metres. */
  function sizePoints() {
    const { nodeRefFromName, scene } = window.__viserMutable;
    const scale = POINT_PX * drawing(scene).viewport.dpr * controls().distance;
    for (const name of POINTS) {
      nodeRefFromName[name]?.traverse(({ isPoints, material }) => {
        if (isPoints) material.uniforms.scale.value = scale;
      });
    }
  }

  /** The map is seen from above only: viser would draw its other side, too, and set up both anew for every picture. */
  function drawMapOnce() {
    window.__viserMutable.nodeRefFromName["/occupancy"]?.traverse(({ material }) => {
      if (!material?.map || material.forceSinglePass) return;
      material.forceSinglePass = true;
      material.needsUpdate = true; // from here on it has a map
    });
  }

  let ticked = () => {};

  /** Calls `run(viser's state)` before every picture. */
  const onTick = (run) => (ticked = run);

  /** viser makes objects anew when what they hold changes its size, and sizes points itself: ours go before every picture. */
  function keep() {
    ticked(window.__viserMutable);
    applyHidden();
    sizePoints();
    drawMapOnce();
  }

  /** The state of what draws a scene (react-three-fiber's store). */
  const drawing = (scene) => scene.__r3f.root.getState();

  /**
   * One picture for each change. viser draws on for a quarter of a second, so always at ten scans a second, and the first
   * picture lacks the change; and it takes a few pictures a second for a slow machine, on which it draws more coarsely.
   */
  function drawOnDemand() {
    const viser = window.__viserMutable;
    const { invalidate, set, setDpr } = drawing(viser.scene);
    viser.requestRender = () => {
      viser.drainMessageQueue?.();
      invalidate();
    };
    set({ setDpr: () => setDpr([1, 2]) }); // as fine as the screen is, within these
    viser.scene.onBeforeRender = keep;
    viser.backgroundMaterial.visible = false; // of a picture that is never there, as large as the view
  }

  async function start() {
    while (!controls() || !camera()) await pause(50);
    applyMode();
    controls().addEventListener("update", () => looked());
    window.addEventListener("resize", () => looked());
    drawOnDemand();
  }

  const style = document.createElement("style");
  style.textContent = STYLE;
  document.head.append(style);
  window.addEventListener("keydown", forwardKey, true);
  window.addEventListener("wheel", () => (moved ||= !placing), { capture: true, passive: true });
  window.addEventListener("pointerdown", (event) => (fingers++, (pressed = event)), true);
  for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, () => (fingers = Math.max(0, fingers - 1)), true);
  window.addEventListener("pointermove", drag, true);
  const ready = start();
  window.lidarView = { setRotate, fit, look, setPlacing, floorToWindow, onLook, onTick, hide };
})();
