// What a user can do, as one request each. Failures are reported; callers need not catch.

import { Problem, request } from "./api.js";
import { optimistic } from "./optimistic.js";
import { choose, forgetOwn, overrule, withOwn } from "./own.js";
import { get, set } from "./store.js";
import { clearToasts, report } from "./toasts.js";
import { chooseTopic } from "./topics.js";

const shared = optimistic("settings", (change) => request("PATCH", "settings", change), withOwn);

/** The settings as this browser shows them: the server's, but for what belongs to each browser alone. */
export const settings = {
  accept(value) {
    overrule(value);
    shared.accept(value);
  },
  /** Wants a change; what belongs to this browser is kept here. */
  async patch(change) {
    const rest = choose(change);
    shared.publish();
    if (Object.keys(rest).length) await shared.patch(rest);
  },
  /** Wants a change on the server, for every browser. */
  share: (change) => shared.patch(change),
  /** Shows everything as the server has it. */
  forgetOwn() {
    forgetOwn();
    shared.publish();
  },
};
export const transport = optimistic("source", (change) => request("PATCH", "source", change));

/** The value at a dotted path of the settings. */
export const setting = (path) => path.split(".").reduce((node, key) => node?.[key], get("settings"));

/** Changes one setting by its dotted path. */
export function changeSetting(path, value) {
  return settings.patch(path.split(".").reduceRight((inner, key) => ({ [key]: inner }), value));
}

export const toggleSetting = (path) => changeSetting(path, !setting(path));

const NOT_OPENED = {
  device: "The device could not be opened",
  emulator: "The emulator could not be started",
  simulation: "The simulation could not be started",
  recording: "The recording could not be opened",
};

/** Opens a source, asking for the topic where several fit. Resolves to whether it plays. */
export async function open(source) {
  set("opening", source);
  try {
    await request("PUT", "source", source);
    clearToasts("source");
    return true;
  } catch (problem) {
    const topics = problem instanceof Problem && problem.members.topics;
    if (!topics?.length) {
      report(problem, NOT_OPENED[source.kind], "source");
      return false;
    }
    const topic = await chooseTopic(source.name, topics);
    return topic ? open({ ...source, topic }) : false;
  } finally {
    set("opening", null);
  }
}

export const step = (by) => attempt(() => request("POST", "source/step", { by }));

export const isPlaying = ({ state }) => state === "playing" || state === "loading";

export function togglePlaying() {
  transport.patch({ state: isPlaying(get("source")) ? "paused" : "playing" });
}

let selecting = Promise.resolve(); // the request before: selections get to the server in the order they were made

/**
 * Selects {corner} or {landmark} by its id, null none; whether it did: one that is gone by now leaves the selection as
 * it was. A wall that was inspected is so no longer: it is corner or wall.
 */
export async function select(change) {
  const before = get("selection");
  if ("corner" in change) for (const wall of ["wall", "mappedWall"]) set(wall, null);
  set("selection", { ...before, ...change });
  try {
    selecting = selecting.catch(() => {}).then(() => request("PUT", "selection", change));
    await selecting;
    return true;
  } catch (problem) {
    set("selection", before);
    if (problem.status !== 404) report(problem);
    return false;
  }
}

export const selectNothing = () => select({ corner: null, landmark: null });

/** Runs what may fail; reports the failure under the title. */
export async function attempt(action, title) {
  try {
    return await action();
  } catch (problem) {
    report(problem, title);
    return undefined;
  }
}
