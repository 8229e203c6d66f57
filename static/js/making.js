// A finished map of a whole recording, made by the server beside what plays: how far it is, and what came of it.

import { address, Problem, request } from "./api.js";
import { attempt } from "./actions.js";
import { $, el, remake, setText } from "./dom.js";
import { localizeIn } from "./maps.js";
import { get, on, set } from "./store.js";
import { report, toast } from "./toasts.js";
import { chooseTopic } from "./topics.js";
import { duration, wholeNumber } from "./units.js";

const ASK_MS = 500;
const STATUS = "map/making";

const bar = el("progress", { max: 1, value: 0, "aria-label": "Scans in the map" });
const text = el("output", {});
const progress = el(
  "div",
  { id: "making-progress", class: "job", hidden: true },
  bar,
  text,
  el("button", { type: "button", class: "button", onclick: cancel }, "Cancel"),
);

export function mountMaking() {
  set("making", null);
  $("library-list").before(progress, el("div", { id: "made" }));
  on(["making"], draw);
  on(["connection"], (connection) => connection === "open" && ask());
}

/** Makes a map of a recording of the server's folder; of one with several lidars, of the one that is chosen. */
export async function makeMap(recording, topic = undefined) {
  try {
    await request("POST", STATUS, { recording, ...(topic && { topic }) });
    await ask();
    requestAnimationFrame(() => progress.scrollIntoView({ block: "nearest" })); // drawn by then
  } catch (problem) {
    const topics = problem instanceof Problem && problem.members.topics;
    if (!topics?.length) return report(problem, "The map could not be made");
    const chosen = await chooseTopic(recording, topics, "map");
    if (chosen) await makeMap(recording, chosen);
  }
}

async function cancel() {
  await attempt(() => request("DELETE", STATUS), "The map could not be cancelled");
  await ask();
}

let timer = 0;

/** Asks how far it is, again and again while it runs, whoever began it. */
async function ask() {
  clearTimeout(timer);
  const before = get("making");
  const found = (await request("GET", STATUS).catch(() => null))?.making ?? null;
  set("making", found);
  clearTimeout(timer); // of a question that was asked meanwhile
  if (found?.state === "running") timer = setTimeout(ask, ASK_MS);
  else if (before?.state === "running" && found?.state === "finished") tell(found);
}

function tell({ recording, session }) {
  toast(`Made of all scans of ${recording}.`, {
    title: `Map ${session} is finished`,
    action: { label: "Localize in it", run: () => localizeIn(session) },
  });
}

function draw(making) {
  const isRunning = making?.state === "running";
  progress.hidden = !isRunning;
  if (isRunning) {
    const { done, total } = making;
    if (total) bar.value = Math.min(done / total, 1);
    else bar.removeAttribute("value");
    setText(text, progressText(making));
  }
  remake($("made"), [making && { ...making, done: 0, elapsed_s: isRunning || making.elapsed_s }], () => outcome(making));
}

function progressText({ recording, done, total }) {
  if (total && done >= total) return `Map of ${recording}: adjusting all scans`;
  return `Map of ${recording}: ${wholeNumber(done)}${total ? ` of ${wholeNumber(total)}` : ""} scans`;
}

function outcome(making) {
  if (making?.state === "failed") return [el("p", { class: "fault", role: "alert" }, `No map of ${making.recording}: ${making.error}`)];
  if (making?.state !== "finished") return [];
  const { recording, session, elapsed_s: took } = making;
  const files = el("a", { href: address(`${STATUS}/files`).href, download: `map-${session}.zip` }, "Save all files, with the poses");
  return [el("p", { class: "muted" }, `Map ${session} of ${recording}, made in ${duration(took)}. `, files)];
}
