// Light or dark. The scene's theme is the server's and shared, so the page follows the settings; the first
// browser to arrive brings its preference along.

import { request } from "./api.js";
import { $ } from "./dom.js";
import { attempt, changeSetting, setting } from "./session.js";
import { on } from "./store.js";

const prefersLight = matchMedia("(prefers-color-scheme: light)");

export function mountTheme() {
  on(["settings"], ({ view }) => (document.documentElement.dataset.theme = view.theme));
  $("theme").addEventListener("click", toggleTheme);
}

export function toggleTheme() {
  const theme = setting("view.theme") === "dark" ? "light" : "dark";
  localStorage.setItem("theme", theme);
  changeSetting("view.theme", theme);
}

/** Sets the theme this browser was left with or prefers, unless others are watching already. */
export async function bringPreference() {
  const preferred = localStorage.getItem("theme") ?? (prefersLight.matches ? "light" : "dark");
  if (preferred === setting("view.theme")) return;
  const health = await attempt(() => request("GET", "health"));
  if (health && health.clients <= 1) await changeSetting("view.theme", preferred);
}
