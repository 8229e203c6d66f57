// Drawings that are made anew with their data, and the round numbers of their axes.

const NAMESPACE = "http://www.w3.org/2000/svg";
const STEPS = [1, 2, 5];

/** Makes an element of a drawing; `method`, if given, is the one whose colour it has as --colour. */
export function shape(tag, { method, ...attributes } = {}, ...children) {
  const node = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (method) node.style.setProperty("--colour", `var(--method-${method})`);
  node.append(...children);
  return node;
}

/** An empty drawing, which says in its label what it shows. */
export const drawing = (width, height, name) =>
  shape("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", class: `drawing ${name}` });

/** Round numbers on a logarithmic scale: powers of ten, with 2 and 5 of each if there are few. */
export function logTicks(low, high) {
  const decades = [];
  for (let power = Math.floor(Math.log10(low)); 10 ** power <= high; power++) decades.push(10 ** power);
  const within = (ticks) => ticks.filter((tick) => tick >= low && tick <= high);
  const powers = within(decades);
  return powers.length > 2 ? powers : within(decades.flatMap((power) => STEPS.map((step) => step * power)));
}

/** A round step that parts a length in at least `parts`. */
export function roundStep(length, parts) {
  const power = 10 ** Math.floor(Math.log10(length / parts));
  return power * STEPS.findLast((step) => step * power <= length / parts);
}
