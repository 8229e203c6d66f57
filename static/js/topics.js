// Asks which lidar topic of a recording is meant.

import { $, el } from "./dom.js";

/** Resolves to the chosen topic, or null if the dialog was dismissed; `verb` is what is done with it: play or map. */
export function chooseTopic(name, topics, verb = "play") {
  const dialog = $("topic-dialog");
  const form = el(
    "form",
    { method: "dialog" },
    el("h2", { id: "topic-title" }, "Several lidars in this recording"),
    el("p", { class: "muted" }, `${name} holds more than one lidar topic. Choose the one to ${verb}.`),
    el(
      "fieldset",
      { class: "choices" },
      el("legend", { class: "visually-hidden" }, "Topic"),
      ...topics.map(choice),
    ),
    el(
      "div",
      { class: "dialog-buttons" },
      el("button", { class: "button", type: "button", onclick: () => dialog.close("") }, "Cancel"),
      el("button", { class: "button strong", value: "chosen" }, `${verb[0].toUpperCase()}${verb.slice(1)} this topic`),
    ),
  );
  dialog.replaceChildren(form);
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((resolve) => {
    const done = () => resolve(dialog.returnValue === "chosen" ? new FormData(form).get("topic") : null);
    dialog.addEventListener("close", done, { once: true });
  });
}

function choice(topic, position) {
  const radio = el("input", { type: "radio", name: "topic", value: topic, checked: position === 0 });
  return el("label", { class: "choice" }, radio, topic);
}
