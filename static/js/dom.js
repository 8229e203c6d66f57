// Making and finding elements.

export const $ = (id) => document.getElementById(id);

/** Makes an element: functions under "on…" listen, other non-strings become properties, strings attributes. */
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (typeof value === "string") node.setAttribute(key, value);
    else node[key] = value;
  }
  node.append(...children);
  return node;
}

/** An icon of the sprite in index.html. */
export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  svg.setAttribute("aria-hidden", "true");
  use.setAttribute("href", `#icon-${name}`);
  svg.append(use);
  return svg;
}

/** Changes which icon a button made with `icon` shows. */
export function setIcon(button, name) {
  button.querySelector("use").setAttribute("href", `#icon-${name}`);
}

export function iconButton(name, label, onclick) {
  return el(
    "button",
    { type: "button", class: "icon", "aria-label": label, title: label, "data-key": label, onclick },
    icon(name),
  );
}

/** A patch of a method's colour; the name is always written beside it. */
export function swatch(method) {
  const patch = el("span", { class: "swatch", "aria-hidden": "true" });
  patch.style.setProperty("--colour", `var(--method-${method})`);
  return patch;
}

/**
 * Makes a node's children anew only when what they show has changed: until then focus and open lists stay. The focus goes
 * to what has the same key, of a row that has gone to the one in its place.
 */
export function remake(node, shown, make) {
  const key = JSON.stringify(shown);
  if (node.shown === key) return;
  node.shown = key;
  const held = node.contains(document.activeElement) ? document.activeElement : null;
  const place = [...node.querySelectorAll("li")].indexOf(held?.closest("li"));
  node.replaceChildren(...make());
  if (!held || held.isConnected) return;
  const again = keyed(node, held.dataset.key);
  if (again) again.focus();
  else if (place >= 0) focusRow(node, place);
}

/** The control with a key, as `remake` makes it once more. */
export const keyed = (node, key) => node.querySelector(`[data-key="${CSS.escape(key)}"]`);

function focusRow(node, place) {
  const rows = node.querySelectorAll("li");
  const next = rows[Math.min(place, rows.length - 1)]?.querySelector("button, input");
  if (next) next.focus();
  else focusHeading(node);
}

/** Where to go on in a section in which the last thing to press has gone. */
export function focusHeading(node) {
  const heading = node.closest("section").querySelector("h2");
  heading.tabIndex = -1;
  heading.focus();
}

/** Writes text only where it differs, into the text node that is there: nothing is laid out for an equal value. */
export function setText(node, text) {
  const value = String(text);
  const first = node.firstChild;
  if (first?.nodeType !== Node.TEXT_NODE) node.prepend(value);
  else if (first.data !== value) first.data = value;
}
