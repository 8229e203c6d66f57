// The scene's frame: its keys reach the page's shortcuts, its tools are the page's buttons.

import { $ } from "./dom.js";
import { setting, toggleSetting } from "./session.js";
import { on } from "./store.js";

const view = () => $("scene").contentWindow?.lidarView;

/** `press(event)` receives the keys pressed in the scene. */
export function mountScene(press) {
  $("fit").addEventListener("click", fitScene);
  $("rotate").addEventListener("click", () => toggleSetting("view.rotate"));
  $("scene").addEventListener("load", applyRotation);
  on(["settings"], applyRotation);
  on(["frame"], () => $("stage").classList.remove("waiting"));
  window.addEventListener("message", ({ origin, source, data }) => {
    const ours = origin === location.origin && source === $("scene").contentWindow;
    if (ours && data?.type === "keydown") press(data);
  });
}

export const fitScene = () => view()?.fit();

function applyRotation() {
  const wanted = setting("view.rotate");
  if (wanted === undefined) return;
  $("rotate").setAttribute("aria-pressed", String(wanted));
  view()?.setRotate(wanted);
}
