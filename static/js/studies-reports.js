// Finished reports: a list, and the one chosen, which the address keeps. A report that is just finished is shown;
// on a wide page the newest one is while none is chosen.

import { address, request } from "./api.js";
import { $, el, iconButton, remake, setText } from "./dom.js";
import { get, on, set } from "./store.js";
import { ask, report as tell } from "./toasts.js";
import { bytes, duration, fineDegrees, millimetres, moment } from "./units.js";

const wide = matchMedia("(min-width: 900px)");

let watched = false; // whether a study ran while the page was open

/** `refresh` is called when a report was deleted. */
export function mountReports(refresh) {
  on(["studies"], showFinished);
  on(["studies", "hash"], ({ reports, folder }, hash) => {
    const newest = wide.matches ? reports[0] : undefined;
    const chosen = reports.find(({ name }) => hash === hashOf(name)) ?? newest;
    setText($("report-count"), reports.length || "");
    setText($("report-folder"), reports.length ? `Files in ${folder}` : "");
    $("report-none").hidden = reports.length > 0;
    remake($("report-list"), [reports, chosen], () => reports.map((report) => row(report, chosen, refresh)));
    show(chosen);
  });
  on(["settings"], dress);
  $("report").addEventListener("load", dress);
  window.addEventListener("hashchange", keepHash);
  wide.addEventListener("change", keepHash);
  keepHash();
}

const hashOf = (name) => `#report=${name}`;
const keepHash = () => set("hash", location.hash);
const titleOf = (kind) => get("studies").kinds.find(({ name }) => name === kind)?.title ?? kind;

function choose(name) {
  location.hash = hashOf(name);
  requestAnimationFrame(() => requestAnimationFrame(() => $("viewer").scrollIntoView({ block: "nearest" })));
}

function showFinished({ run }) {
  if (watched && run?.state === "finished") choose(run.report);
  watched = run?.state === "running";
}

/** Browsers tell a frame what the system prefers, not what the page shows. */
function dress() {
  const root = $("report").contentDocument?.documentElement;
  if (root) root.style.colorScheme = get("settings")?.view.theme ?? "";
}

function row(report, chosen, refresh) {
  const { name, kind, created } = report;
  const button = el(
    "button",
    { type: "button", class: "entry", "data-key": name, onclick: () => choose(name) },
    el("span", {}, titleOf(kind)),
    el("small", {}, moment(Date.parse(created) / 1e3)),
  );
  if (report === chosen) button.setAttribute("aria-current", "true");
  const remove = iconButton("delete", `Delete ${name}`, () => confirmDelete(report, refresh));
  return el("li", {}, button, remove, el("p", { class: "about muted" }, about(report)));
}

/** What was chosen, in a line. */
function about({ options, took_s, size }) {
  if (!options) return bytes(size);
  const { quick, seed, noise, sigma_range, sigma_bearing, recording, topic, ...numbers } = options;
  const words = [
    quick ? "quick" : "full",
    ...(recording ? [recording] : []),
    ...(topic ? [topic] : []),
    ...Object.entries(numbers).map(([name, value]) => `${value.toLocaleString("en")} ${name}`),
    ...(noise === "settings" ? [`noise ${millimetres(sigma_range)} mm, ${fineDegrees(sigma_bearing)}°`] : []),
    `seed ${seed}`,
    `took ${duration(took_s)}`,
    bytes(size),
  ];
  return words.join(", ");
}

function confirmDelete({ name, kind }, refresh) {
  const run = async () => {
    try {
      await request("DELETE", `studies/reports/${name}`);
    } catch (problem) {
      tell(problem, "The report was not deleted");
    }
    await refresh();
  };
  ask(`\u201c${titleOf(kind)}\u201d (${name}) will be deleted from the server.`, {
    title: "Delete this report?",
    action: { label: "Delete", run },
  });
}

function show(report) {
  $("viewer").hidden = !report;
  const url = report ? address(`studies/reports/${report.name}`).href : "about:blank";
  load($("report"), url);
  if (!report) return;
  setText($("viewer-title"), titleOf(report.kind));
  $("viewer-open").href = $("viewer-download").href = url;
  $("viewer-download").download = `${report.name}.html`;
}

/** In place of what is shown: the way back leads to the report before, not through the frame. */
function load(frame, url) {
  if (frame.dataset.url === url) return;
  frame.dataset.url = url;
  frame.contentWindow.location.replace(url);
}
