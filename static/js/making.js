// Finished maps of whole recordings, made by the server beside what plays, one after the other: how far the one is that
// is made, which ones wait, and what came of those before.

import { address, Problem, request } from "./api.js";
import { attempt } from "./actions.js";
import { $, el, focusHeading, iconButton, keyed, remake, setText } from "./dom.js";
import { begunById, calledById, keyOf, listMaps, localizeIn } from "./maps.js";
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
  el("button", { type: "button", class: "button", onclick: () => cancel(get("making").making.id) }, "Cancel"),
);
const queue = el("ul", { id: "making-queue", class: "entries" });

/** What the store has as "making": as the server tells, with the session of the map that was finished last. */
const known = (found) => ({ ...found, session: found.ended.findLast(isFinished)?.session ?? null });
const isFinished = ({ state }) => state === "finished";

export function mountMaking() {
  set("making", known({ making: null, waiting: [], ended: [] }));
  $("library-list").before(progress, queue, el("div", { id: "made" }));
  on(["making"], draw);
  on(["maps"], () => draw(get("making"))); // they may have other names
  on(["connection", "panel", "makingRevision"], follow);
}

let followed = ""; // what was known when it was last asked for: states come twice a second

/** Asks when somebody has let one be made, or one has ended, and when someone looks. */
function follow(connection, panel, revision) {
  const wanted = [connection, panel, revision].join(" ");
  if (connection === "open" && wanted !== followed) ask();
  followed = wanted;
}

/** What the button that makes a map of a recording says. */
export const makingWords = (recording) => `Make a map of ${recording}`;

/** Makes a map of a recording of the server's folder; of one with several lidars, of the one that is chosen. */
export async function makeMap(recording, topic = undefined) {
  try {
    await request("POST", STATUS, { recording, ...(topic && { topic }) });
    await ask();
    requestAnimationFrame(() => (queue.lastElementChild ?? progress).scrollIntoView({ block: "nearest" })); // drawn by then
  } catch (problem) {
    const topics = problem instanceof Problem && problem.members.topics;
    if (!topics?.length) return report(problem, "The map could not be made");
    const chosen = await chooseTopic(recording, topics, "map");
    if (chosen) await makeMap(recording, chosen);
  }
}

async function cancel(id) {
  await attempt(() => request("DELETE", `${STATUS}?id=${id}`), "The map could not be cancelled");
  await ask();
}

let timer = 0;

/** Asks how far it is, again and again while it runs and someone looks, whoever began it. */
async function ask() {
  clearTimeout(timer);
  const found = await request("GET", STATUS).catch(() => null);
  clearTimeout(timer); // of a question that was asked meanwhile
  if (!found) return;
  const before = get("making");
  set("making", known(found));
  if (isRunning(found) && get("panel") === "sources") timer = setTimeout(ask, ASK_MS);
  const ended = found.ended.filter(({ id }) => !before.ended.some((one) => one.id === id));
  if (ended.some(isFinished)) await listMaps(); // for their names
  if (before.making) ended.forEach(tell);
}

const isRunning = ({ making }) => making?.state === "running";

function tell({ recording, state, session, error }) {
  if (state === "failed") toast(error, { title: `No map of ${recording}`, kind: "error" });
  if (state !== "finished") return;
  toast(`Made of all scans of ${recording}.`, {
    title: `${begunById(session)} is finished`,
    action: { label: "Localize in it", run: () => localizeIn(session) },
    about: keyOf(session),
  });
}

function draw(found) {
  const { making, waiting, ended } = found;
  const isHeld = progress.contains(document.activeElement);
  progress.hidden = !isRunning(found);
  if (isHeld && progress.hidden) leave(making?.recording);
  if (isRunning(found)) {
    const { done, total } = making;
    if (total) bar.value = Math.min(done / total, 1);
    else bar.removeAttribute("value");
    setText(text, progressText(making));
  }
  queue.hidden = !waiting.length;
  remake(queue, waiting, () => waiting.map(waitingLine));
  const names = ended.filter(isFinished).map(({ session }) => calledById(session));
  remake($("made"), [ended, names], () => [...ended.filter(isLast).flatMap(outcome), ...(ended.some(isFinished) ? [kept()] : [])]);
}

/** Where to go on after "Cancel" has gone with what was made: its recording. */
function leave(recording) {
  const again = keyed($("library-list"), makingWords(recording));
  if (again) again.focus();
  else focusHeading(progress);
}

function waitingLine({ id, recording }) {
  const name = `Do not make the map of ${recording}`;
  const line = el("p", { class: "entry" }, el("span", {}, `Map of ${recording}: waiting`));
  return el("li", {}, line, iconButton("close", name, () => cancel(id)));
}

function progressText({ recording, done, total }) {
  if (total && done >= total) return `Map of ${recording}: adjusting all scans`;
  return `Map of ${recording}: ${wholeNumber(done)}${total ? ` of ${wholeNumber(total)}` : ""} scans`;
}

/** What failed is told of until its recording was tried again. */
const isLast = ({ state, recording }, place, ended) =>
  state === "finished" || ended.findLastIndex((one) => one.recording === recording) === place;

const kept = () => el("p", { class: "muted" }, "The server keeps the files of the last eight until it ends.");

/** Saves the files if the server still has them: of a download that fails a browser says nothing. */
async function save(event, { id, session, recording }) {
  event.preventDefault();
  const { href } = event.currentTarget;
  const found = await attempt(() => request("GET", STATUS), "The files cannot be saved");
  if (!found) return;
  const isKept = found.ended.some((one) => one.id === id && one.session === session);
  if (isKept) return el("a", { href, download: "" }).click(); // named by the server
  toast(`The server keeps them of the last eight maps until it ends. Make the map of ${recording} once more to save them.`, {
    title: "These files are gone",
    kind: "error",
  });
}

function outcome(made) {
  const { id, recording, state, session, error, elapsed_s: took } = made;
  if (state === "failed") return [el("p", { class: "fault", role: "alert" }, `No map of ${recording}: ${error}`)];
  if (state !== "finished") return [];
  const href = address(`${STATUS}/files?id=${id}`).href;
  const words = "Save all files, with the poses";
  const onclick = (event) => save(event, made);
  const files = el("a", { href, download: "", "aria-label": `${words}, of ${calledById(session)}`, onclick }, words);
  return [el("p", { class: "muted" }, `${begunById(session)} of ${recording}, made in ${duration(took)}. `, files)];
}
