// What the page knows, by key: connection, settings, source, selection, ready, frame, methods, fields.
// Rooms read it and are told of changes once per animation frame, so a hidden page does no work.

const values = {};
const listeners = [];
const changed = new Set();

export const get = (key) => values[key];

export function set(key, value) {
  values[key] = value;
  if (changed.size === 0) requestAnimationFrame(flush);
  changed.add(key);
}

/** Calls `render` with the values of all keys, in their order, as soon as all are known and after each change. */
export function on(keys, render) {
  listeners.push({ keys, render });
  if (known(keys)) render(...keys.map(get));
}

const known = (keys) => keys.every((key) => values[key] !== undefined);

function flush() {
  const fresh = new Set(changed);
  changed.clear();
  for (const { keys, render } of listeners) {
    if (!keys.some((key) => fresh.has(key)) || !known(keys)) continue;
    try {
      render(...keys.map(get));
    } catch (error) {
      console.error(error); // one room's fault does not darken the others
    }
  }
}
