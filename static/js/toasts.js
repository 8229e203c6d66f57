// Messages that come and go, read out by screen readers. One that is pointed at or has the focus stays. Where there is
// little room, only the newest is seen, with how many more there are.

import { $, el, iconButton, keyed } from "./dom.js";

const QUESTION_MS = 30_000; // for messages that ask something
const LINGER_MS = 12_000;
const LOOK_AGAIN_MS = 2000;
const MOST = 3;

new MutationObserver(() => {
  const more = $("toasts").children.length - 1;
  $("toasts").dataset.more = more > 0 ? `and ${more} more` : "";
}).observe($("toasts"), { childList: true });

let before = null; // what had the focus before a message had it

$("toasts").addEventListener("focusin", ({ relatedTarget: last }) => {
  if (!$("toasts").contains(last)) before = last;
});

/** Shows a message; `action` is an optional {label, run}, `about` what `clearToasts` clears it by, one or more words. */
export function toast(text, { title = "", kind = "info", action = null, about = "", linger = LINGER_MS } = {}) {
  const region = $("toasts");
  const same = [...region.children].find((node) => node.dataset.text === title + text);
  if (same) close(same);
  const node = el("div", { class: `toast ${kind}`, "data-about": about });
  node.dataset.text = title + text;
  const words = el("div", {}, ...(title ? [el("strong", {}, title)] : []), el("p", {}, text));
  node.append(words);
  if (action) node.append(actionButton(node, action));
  node.append(iconButton("close", "Dismiss this message", () => close(node)));
  region.append(node);
  while (region.children.length > MOST) close(region.firstElementChild);
  removeLater(node, linger);
}

let asker = null; // what had the focus when the question was asked

/** Asks something; an earlier question that has no answer yet is given up, lest the answer to one is taken for another's. */
export function ask(text, { title, action, about = "" }) {
  clearToasts("question");
  asker = document.activeElement;
  toast(text, { title, action, about: `question ${about}`, linger: QUESTION_MS });
}

/** Removes the messages about something that is settled, or gone: the "source", the "connection", "map-3". */
export function clearToasts(about) {
  for (const node of $("toasts").querySelectorAll(`[data-about~="${about}"]`)) close(node);
}

/** Whether a message is there about something whose word begins so: "map-". */
export const isToldOf = (beginning) => Boolean($("toasts").querySelector(`[data-about*="${beginning}"]`));

/** Answers a question with no, where one waits, and says whether one did; what asked has the focus again. */
export function refuse() {
  const question = $("toasts").querySelector('[data-about~="question"]');
  if (!question) return false;
  close(question);
  giveBack(asker);
  return true;
}

/** Closes the newest message, and says whether there was one. */
export function closeNewest() {
  const newest = $("toasts").lastElementChild;
  if (newest) close(newest);
  return Boolean(newest);
}

/** The focus, if the message has it, goes back to where it was. */
function close(node) {
  const isHeld = node.contains(document.activeElement);
  node.remove();
  if (isHeld) giveBack(before);
}

/** Focuses a control, or what has taken its place in a list that was made anew; the view where there is neither. */
function giveBack(control) {
  const now = control?.isConnected ? control : control && keyed(document, control.dataset.key);
  (now?.checkVisibility() ? now : $("stage"))?.focus({ preventScroll: true });
}

function removeLater(node, wait) {
  setTimeout(() => {
    if (node.matches(":hover, :focus-within")) removeLater(node, LOOK_AGAIN_MS);
    else if (node.isConnected && !node.checkVisibility()) removeLater(node, wait); // a newer one is seen in its place
    else node.remove();
  }, wait);
}

/** Shows what went wrong, in the words of the server where it has some. */
export function report(error, title = "Something went wrong", about = "") {
  if (!(error instanceof Error)) throw error;
  console.warn(error.message);
  if (error.status === 0) toast(error.message, { title: error.title, kind: "error", about: "connection" });
  else toast(error.message, { title, kind: "error", about });
}

function actionButton(node, { label, run }) {
  const onclick = () => {
    close(node);
    run();
  };
  return el("button", { type: "button", class: "button", onclick }, label);
}
