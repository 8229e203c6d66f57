// The form in which a name is changed, in the place of what has it in a list.

import { el } from "./dom.js";

/** `rename` is given the new name, and says whether it is that now: then `end` is called, as it is on Escape. */
export function renameForm({ value, label, key, selected = value.length, rename, end, ...rules }) {
  const input = el("input", { type: "text", value, "aria-label": label, "data-key": key, ...rules });
  const submit = async (event) => {
    event.preventDefault();
    if (await rename(input.value.trim())) end();
  };
  const cancel = ({ key: pressed }) => pressed === "Escape" && end();
  const form = el(
    "form",
    { onsubmit: submit, onkeydown: cancel },
    input,
    el("button", { type: "submit", class: "button" }, "Rename"),
  );
  requestAnimationFrame(() => {
    input.focus();
    input.setSelectionRange(0, selected);
  });
  return form;
}
