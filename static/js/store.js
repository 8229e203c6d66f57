// What the page knows, by key: what the server streams (settings, source, selection, localization, recorder, ready,
// sessionsRevision, makingRevision, frame), what was asked for (methods, clusterers, fields, simulation, repeatability, ...)
// and what the page itself is doing (connection, opening, panel, ...). Modules read it and are called after changes, once
// per animation frame, so a hidden page does no work.

const values = {};
const listeners = new Set();
const changed = new Set();

export const get = (key) => values[key];

export function set(key, value) {
  values[key] = value;
  if (changed.size === 0) requestAnimationFrame(flush);
  changed.add(key);
}

/**
 * Calls `render` with the values of all keys, in their order, as soon as all are known and after each change; until the
 * function that is returned is called.
 */
export function on(keys, render) {
  const listener = { keys, render };
  listeners.add(listener);
  if (known(keys)) render(...keys.map(get));
  return () => listeners.delete(listener);
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
      console.error(error); // one module's fault does not stop the others
    }
  }
}
