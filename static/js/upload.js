// Uploading recordings: chosen or dropped anywhere on the page, sent with a progress bar, then played.

import { address, NO_ANSWER, Problem, problemOf } from "./api.js";
import { $, el, icon, iconButton, setText } from "./dom.js";
import { refreshRecordings } from "./recordings.js";
import { open } from "./actions.js";
import { showPanel } from "./tabs.js";
import { ask, report } from "./toasts.js";
import { bytes } from "./units.js";

const FORMATS = "ROS 1 and 2 bags, MCAP, CARMEN logs, RPLIDAR CSV and dumps, MATLAB, NumPy";

export function mountUpload() {
  const picker = el("input", {
    type: "file",
    class: "visually-hidden",
    id: "file",
    "aria-label": "Recording to upload",
  });
  picker.addEventListener("change", () => {
    upload(picker.files[0]);
    picker.value = "";
  });
  const button = el("label", { class: "button", for: "file" }, icon("upload"), "Choose a file");
  const hint = el("p", { class: "muted" }, `Or drop it anywhere on the page. ${FORMATS}.`);
  $("upload").append(picker, button, hint, el("ul", { id: "uploads" }));
  watchDrops(window);
  const scene = $("scene");
  watchDrops(scene.contentWindow); // it may be loaded already
  scene.addEventListener("load", () => watchDrops(scene.contentWindow));
}

/** A drag over the page, the scene's frame included, raises a veil that takes the drop. */
function watchDrops(target) {
  const veil = $("drop");
  target.addEventListener("dragenter", ({ dataTransfer }) => {
    if (dataTransfer?.types.includes("Files")) veil.hidden = false;
  });
  if (target !== window) return;
  veil.addEventListener("dragover", (event) => event.preventDefault());
  veil.addEventListener("dragleave", () => (veil.hidden = true));
  veil.addEventListener("drop", (event) => {
    event.preventDefault();
    veil.hidden = true;
    upload(event.dataTransfer.files[0]);
  });
}

/** Uploads a file, then opens it. */
async function upload(file, overwrite = false) {
  if (!file) return;
  showPanel("sources");
  const row = progressRow(file);
  try {
    await row.sent(overwrite);
    await refreshRecordings();
    await open({ kind: "recording", name: file.name });
  } catch (problem) {
    if (problem.status === 409 && !overwrite) offerOverwrite(file);
    else if (problem.status !== ABORTED) report(problem, "The upload failed");
  } finally {
    row.node.remove();
  }
}

function offerOverwrite(file) {
  const action = { label: "Replace it", run: () => upload(file, true) };
  const text = `The server already has a recording named ${file.name}.`;
  ask(text, { title: "Not uploaded", action });
}

const ABORTED = -1;

/** A list entry with bar, figure and cancel button; `sent(overwrite)` starts it and resolves when it is stored. */
function progressRow(file) {
  const transfer = new XMLHttpRequest();
  const bar = el("progress", { max: 1, value: 0, "aria-label": `Uploading ${file.name}` });
  const figure = el("small", {}, "");
  const cancel = iconButton("close", `Cancel the upload of ${file.name}`, () => transfer.abort());
  const node = el("li", { class: "upload" }, el("span", {}, file.name), figure, cancel, bar);
  $("uploads").append(node);
  transfer.upload.onprogress = ({ loaded, total }) => {
    bar.value = loaded / total;
    setText(figure, loaded < total ? `${bytes(loaded)} of ${bytes(total)}` : "Checking");
  };
  return { node, sent: (overwrite) => send(transfer, file, overwrite) };
}

/** fetch cannot tell how much of a body is sent; XMLHttpRequest can. */
function send(transfer, file, overwrite) {
  const path = `recordings/${encodeURIComponent(file.name)}${overwrite ? "?overwrite=true" : ""}`;
  return new Promise((resolve, reject) => {
    transfer.open("PUT", address(path));
    transfer.onload = () =>
      transfer.status < 300 ? resolve() : reject(problemOf(transfer.status, transfer.responseText));
    transfer.onerror = () => reject(new Problem(NO_ANSWER));
    transfer.onabort = () => reject(new Problem({ status: ABORTED }));
    transfer.send(file);
  });
}
