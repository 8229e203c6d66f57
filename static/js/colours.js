// The colours and dashes of the methods as the server declares them.

import { get, on } from "./store.js";

export function mountColours() {
  on(["methods", "settings"], (methods) => {
    for (const { name } of methods)
      document.documentElement.style.setProperty(`--method-${name}`, methodColour(name));
  });
}

/** The colour of a method as #rrggbb, readable in the current theme. */
export function methodColour(name) {
  const { colour, colour_light: light } = get("methods").find((method) => method.name === name);
  return document.documentElement.dataset.theme === "light" ? light : colour;
}
