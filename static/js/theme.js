// Light or dark, as each browser has it. The points and walls of the scene are drawn once for all: in the theme of the
// only browser there is; where several differ, those that want the other one turn its colours over.

import { request } from "./api.js";
import { $ } from "./dom.js";
import { attempt, changeSetting, setting, settings } from "./actions.js";
import { ownChoices } from "./own.js";
import { on } from "./store.js";

const prefersLight = matchMedia("(prefers-color-scheme: light)");

export function mountTheme() {
  on(["settings"], ({ view }) => {
    document.documentElement.dataset.theme = view.theme;
    $("scene").classList.toggle("turned", ownChoices().includes("theme"));
  });
  $("theme").addEventListener("click", toggleTheme);
}

export function toggleTheme() {
  const theme = setting("view.theme") === "dark" ? "light" : "dark";
  localStorage.setItem("theme", theme);
  wear(theme);
}

/** Shows a theme here, and has the scene drawn in it if nobody else is looking. */
async function wear(theme) {
  await changeSetting("view.theme", theme);
  const health = await attempt(() => request("GET", "health"));
  if (health && health.clients <= 1) await settings.share({ view: { theme } });
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
  if (isAnother) await wear(shown);
}

/** Sets the theme this browser was left with or prefers. */
export async function bringPreference() {
  const preferred = localStorage.getItem("theme") ?? (prefersLight.matches ? "light" : "dark");
  if (preferred !== setting("view.theme")) await wear(preferred);
}
