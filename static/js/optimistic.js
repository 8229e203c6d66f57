// A server-side object the page edits: shown as the user wants it at once, confirmed by the server.
// One request is in flight at a time; what is changed meanwhile is merged into the next one. A drag of a
// slider thus sends as fast as the server answers, and its echo never moves the slider back.

import { set } from "./store.js";
import { report } from "./toasts.js";

/** RFC 7386 merge of plain objects; arrays and scalars are replaced. */
export function merge(target, change) {
  if (!isObject(change)) return change;
  const result = isObject(target) ? { ...target } : {};
  for (const [key, value] of Object.entries(change)) result[key] = merge(result[key], value);
  return result;
}

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** `send(change)` resolves to the whole new object, which is kept in the store under `key` as `shown` makes it. */
export function optimistic(key, send, shown = (value) => value) {
  let server;
  let sending = null;
  let queued = null;
  let pushes = 0;

  const pending = () => merge(sending ?? {}, queued ?? {});
  const publish = () => server && set(key, shown(merge(server, pending())));

  async function drain() {
    while (queued) {
      [sending, queued] = [queued, null];
      const before = pushes;
      try {
        const answer = await send(sending);
        if (pushes === before) server = answer; // what was pushed meanwhile is no older, and may be newer
      } catch (problem) {
        report(problem, "The change was refused");
      }
      sending = null;
      publish();
    }
  }

  return {
    /** Takes the server's word, as pushed over the stream. */
    accept(value) {
      server = value;
      pushes++;
      publish();
    },
    /** Wants a change; resolves when everything wanted so far is answered. Failures are reported. */
    async patch(change) {
      queued = merge(queued ?? {}, change);
      publish();
      if (!sending) await drain();
    },
    pending,
    publish,
  };
}
