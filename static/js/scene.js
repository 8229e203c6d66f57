// The scene's frame: its keys reach the page's shortcuts, its tools are the page's buttons.

import { $ } from "./dom.js";
import { setting, toggleSetting } from "./session.js";
import { on } from "./store.js";

/** What the scene's frame offers, once it has started. */
export const view = () => $("scene").contentWindow?.lidarView;

const handlers = new Map(); // by the type of the message

/** Calls `run(message)` for messages of a type from the scene's frame. */
export const onSceneMessage = (type, run) => handlers.set(type, run);

/** `press(event)` receives the keys pressed in the scene. */
export function mountScene(press) {
  onSceneMessage("keydown", press);
  $("fit").addEventListener("click", fitScene);
  $("rotate").addEventListener("click", () => toggleSetting("view.rotate"));
  $("scene").addEventListener("load", applyRotation);
  on(["settings"], applyRotation);
  on(["frame"], () => $("stage").classList.remove("waiting"));
  window.addEventListener("message", ({ origin, source, data }) => {
    const ours = origin === location.origin && source === $("scene").contentWindow;
    if (ours) handlers.get(data?.type)?.(data);
  });
}

export const fitScene = () => view()?.fit();

function applyRotation() {
  const wanted = setting("view.rotate");
  if (wanted === undefined) return;
  $("rotate").setAttribute("aria-pressed", String(wanted));
  view()?.setRotate(wanted);
}
