// Messages that come and go, read out by screen readers. Errors stay until dismissed.

import { $, el, iconButton } from "./dom.js";

const LINGER_MS = 6000;
const MOST = 4;

/** Shows a message; `action` is an optional {label, run}. */
export function toast(text, { title = "", kind = "info", action = null } = {}) {
  const region = $("toasts");
  const same = [...region.children].find((node) => node.dataset.text === title + text);
  same?.remove();
  const node = el("div", { class: `toast ${kind}` });
  node.dataset.text = title + text;
  const words = el("div", {}, ...(title ? [el("strong", {}, title)] : []), el("p", {}, text));
  node.append(words);
  if (action) node.append(actionButton(node, action));
  node.append(iconButton("close", "Dismiss this message", () => node.remove()));
  region.append(node);
  while (region.children.length > MOST) region.firstElementChild.remove();
  if (kind !== "error" && !action) setTimeout(() => node.remove(), LINGER_MS);
}

/** Shows what went wrong, in the words of the server where it has some, under a better title if there is one. */
export function report(error, title = error.title ?? "Something went wrong") {
  if (!(error instanceof Error)) throw error;
  console.warn(error.message);
  toast(error.message, { title, kind: "error" });
}

function actionButton(node, { label, run }) {
  const onclick = () => {
    node.remove();
    run();
  };
  return el("button", { type: "button", class: "button", onclick }, label);
}
