// The page of studies: what there is, what runs, what came out. The server is asked again and again.

import { request } from "./api.js";
import { on, set } from "./store.js";
import { mountForms } from "./studies-forms.js";
import { mountReports } from "./studies-reports.js";
import { mountRun } from "./studies-run.js";
import { clearToasts, refuse, report } from "./toasts.js";

const RUNNING_MS = 700;
const IDLE_MS = 4000;

let timer = 0;

/** Learns the state of the studies; a failure is told once, until it works again. */
export async function refresh() {
  clearTimeout(timer);
  let studies = null;
  try {
    studies = await request("GET", "studies");
    clearToasts("connection");
    set("studies", studies);
  } catch (problem) {
    report(problem, "The studies could not be listed");
  }
  clearTimeout(timer);
  if (!document.hidden) timer = setTimeout(refresh, studies?.run?.state === "running" ? RUNNING_MS : IDLE_MS);
}

/** The recordings there are; and the settings, for the noise set now and for light or dark. */
async function look() {
  try {
    const [settings, listing] = await Promise.all([request("GET", "settings"), request("GET", "recordings")]);
    set("settings", settings);
    set("recordings", listing.recordings);
  } catch (problem) {
    report(problem);
  }
}

mountForms(refresh);
mountRun(refresh);
mountReports(refresh);
on(["settings"], ({ view }) => (document.documentElement.dataset.theme = view.theme));
document.addEventListener("visibilitychange", () => {
  if (document.hidden) return;
  look();
  refresh();
});
document.addEventListener("keydown", ({ key }) => key === "Escape" && refuse());
look();
refresh();
