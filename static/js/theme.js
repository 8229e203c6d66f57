// Light or dark. The scene's theme is the server's and shared, so the page follows the settings; the first
// browser to arrive brings its preference along, and a server that has started anew is told what is shown.

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

let born = null; // Unix seconds when the server started

/** To be called at every connection. */
export async function keepTheme() {
  const shown = document.documentElement.dataset.theme;
  const health = await attempt(() => request("GET", "health"));
  if (!health) return;
  const started = Date.now() / 1000 - health.uptime_s;
  const isAnother = born !== null && started - born > 1;
  born = started;
  if (isAnother) await changeSetting("view.theme", shown);
}

/** Sets the theme this browser was left with or prefers, unless others are watching already. */
export async function bringPreference() {
  const preferred = localStorage.getItem("theme") ?? (prefersLight.matches ? "light" : "dark");
  if (preferred === setting("view.theme")) return;
  const health = await attempt(() => request("GET", "health"));
  if (health && health.clients <= 1) await changeSetting("view.theme", preferred);
}
