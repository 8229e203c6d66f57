// The colours of the methods as the server declares them; darker on a light ground, exactly as in the scene.

import { get, on } from "./store.js";

const LIGHT_GROUND = 0.7; // the factor of app/colours.py

export function mountColours() {
  on(["methods", "settings"], (methods) => {
    for (const { name } of methods)
      document.documentElement.style.setProperty(`--method-${name}`, methodColour(name));
  });
}

/** The colour of a method as #rrggbb, readable in the current theme. */
export function methodColour(name) {
  const declared = get("methods").find((method) => method.name === name).colour;
  return document.documentElement.dataset.theme === "light" ? darker(declared) : declared;
}

function darker(colour) {
  const channels = [1, 3, 5].map((at) => Math.floor(parseInt(colour.slice(at, at + 2), 16) * LIGHT_GROUND));
  return "#" + channels.map((value) => value.toString(16).padStart(2, "0")).join("");
}
