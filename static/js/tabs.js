// The panels' tabs. On a wide page the corners have their own place; on a narrow one they are a tab like the others.

import { $ } from "./dom.js";
import { set } from "./store.js";

const KEY = "panel"; // what a reload brings back

/** Whether the panels stand beside the view, not below it. */
export const wide = matchMedia("(min-width: 900px)");

const tabs = () =>
  [...document.querySelectorAll('[role="tab"]')].filter((tab) => !(wide.matches && tab.id === "tab-corners"));

export function mountTabs() {
  for (const tab of document.querySelectorAll('[role="tab"]')) {
    tab.addEventListener("click", () => showPanel(tab.getAttribute("aria-controls")));
  }
  document.querySelector('[role="tablist"]').addEventListener("keydown", walk);
  wide.addEventListener("change", arrange);
  const before = tabs().find((tab) => tab.getAttribute("aria-controls") === sessionStorage.getItem(KEY));
  if (before) showPanel(before.getAttribute("aria-controls"));
  else arrange();
}

/** Shows one panel by its id; `focus` moves the focus to its tab. */
export function showPanel(id, { focus = false } = {}) {
  $("main").dataset.tab = id;
  for (const tab of document.querySelectorAll('[role="tab"]')) {
    const chosen = tab.getAttribute("aria-controls") === id;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    if (chosen && focus) tab.focus();
  }
  sessionStorage.setItem(KEY, id);
  set("panel", id);
}

function arrange() {
  showPanel(wide.matches ? "setup" : "corners");
}

function walk(event) {
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (!by) return;
  event.preventDefault();
  const all = tabs();
  const next = all[(all.indexOf(document.activeElement) + by + all.length) % all.length];
  next.focus();
  showPanel(next.getAttribute("aria-controls"));
}
