// Noise profiles: chosen, saved, deleted, exported and imported as the files that `lidarcore calibrate` writes.

import { Problem, address, request, send } from "./api.js";
import { $, el, icon, iconButton, remake } from "./dom.js";
import { attempt, settings } from "./actions.js";
import { on, set } from "./store.js";
import { ask, report } from "./toasts.js";
import { fixed } from "./units.js";

const DEGREES = 180 / Math.PI;

export function mountProfiles() {
  const picker = el("input", {
    type: "file",
    class: "visually-hidden",
    id: "profile-file",
    accept: ".json",
    "aria-label": "Profile to import",
  });
  picker.addEventListener("change", () => {
    load(picker.files[0]);
    picker.value = "";
  });
  $("profiles").append(
    el("h3", {}, "Noise profiles"),
    el("div", { id: "profile-list" }),
    el(
      "div",
      { class: "buttons" },
      picker,
      el("label", { class: "button", for: picker.id }, icon("upload"), "Import a file"),
    ),
  );
  on(["profiles", "settings"], draw);
}

export async function listProfiles() {
  const found = await attempt(() => request("GET", "profiles"), "The profiles could not be listed");
  if (found) set("profiles", found);
}

export const sameNoise = (one, other) => Object.keys(one).every((part) => one[part] === other[part]);

/** Lets extraction take this noise. */
export const useNoise = (noise) => settings.patch({ extraction: { noise } });

/** Saves a profile, asking first if the name is taken. */
export const saveProfile = (name, noise) => put(name, JSON.stringify({ extraction: { noise } }));

async function put(name, body, overwrite = false) {
  try {
    await send("PUT", `${pathOf(name)}${overwrite ? "?overwrite=true" : ""}`, {
      body,
      headers: { "Content-Type": "application/json" },
    });
    await listProfiles();
  } catch (problem) {
    if (problem.status === 409) offerOverwrite(name, body);
    else report(inWords(problem), "The profile was not saved");
  }
}

/** What is wrong with the content of a file comes with `errors`, and is told as the list of profiles tells it. */
function inWords(problem) {
  if (!problem.members?.errors) return problem;
  return new Problem({ ...problem, detail: `The file is not a profile: ${problem.message.replace(/\.$/, "")}.` });
}

const pathOf = (name) => `profiles/${encodeURIComponent(name)}`;

function offerOverwrite(name, body) {
  const action = { label: "Replace it", run: () => put(name, body, true) };
  ask(`A profile named ${name} already exists.`, { title: "Not saved", action });
}

async function load(file) {
  if (file) await put(file.name.replace(/\.json$/i, ""), await file.text());
}

function draw({ folder, profiles, sensors }, { extraction: { noise } }) {
  remake($("profile-list"), [folder, profiles, noise], () => [
    ...(profiles.length
      ? [
          el("ul", { class: "entries" }, ...profiles.map((profile) => row(profile, noise))),
          el("p", { class: "muted" }, `Files in ${folder}; commands take one as `, el("code", {}, "--settings")),
        ]
      : [el("p", { class: "muted" }, "None yet: calibrate and save, or import a file.")]),
    el("h3", {}, "Usual noise of known sensors, until yours is calibrated"),
    el("ul", { class: "entries" }, ...sensors.map((sensor) => usual(sensor, noise))),
  ]);
}

/** A kind of sensor; what its numbers rest on shows under the one in use, and as a tooltip. */
function usual({ name, title, noise, rests_on: basis }, current) {
  const inUse = sameNoise(noise, current);
  return el("li", {}, choice(name, title, noise, inUse, basis), inUse ? el("p", { class: "about muted" }, basis) : "");
}

function choice(key, text, noise, inUse, title) {
  const button = el(
    "button",
    { type: "button", class: "entry", title, "data-key": `profile-${key}`, onclick: () => useNoise(noise) },
    el("span", {}, text),
    el("small", {}, `${inUse ? "in use, " : ""}${numbers(noise)}`),
  );
  if (inUse) button.setAttribute("aria-current", "true");
  return button;
}

function row({ name, noise, problem }, current) {
  const remove = iconButton("delete", `Delete profile ${name}`, () => confirmDelete(name));
  if (problem) {
    const entry = el("p", { class: "entry" }, el("span", {}, name), el("small", { class: "fault" }, "damaged"));
    return el("li", {}, entry, remove, el("p", { class: "about muted" }, problem));
  }
  const button = choice(name, name, noise, sameNoise(noise, current), `Use profile ${name}`);
  return el("li", {}, button, exportLink(name), remove);
}

const numbers = ({ sigma_range: range, sigma_bearing: bearing }) =>
  `${fixed(1e3 * range, 1)}\u2009mm, ${fixed(DEGREES * bearing, 3)}°`;

const exportLink = (name) =>
  el(
    "a",
    {
      class: "button quiet",
      href: address(pathOf(name)).href,
      download: `${name}.json`,
      "aria-label": `Export profile ${name}`,
    },
    "Export",
  );

function confirmDelete(name) {
  const remove = async () => {
    await attempt(() => request("DELETE", pathOf(name)), "The profile was not deleted");
    await listProfiles();
  };
  ask("The noise settings stay as they are.", {
    title: `Delete profile ${name}?`,
    action: { label: "Delete", run: remove },
  });
}
