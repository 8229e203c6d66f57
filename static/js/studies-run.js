// What runs, or ran last: how far it is, how long it still takes, and what ended it.

import { request } from "./api.js";
import { $, setText } from "./dom.js";
import { on } from "./store.js";
import { report } from "./toasts.js";
import { duration } from "./units.js";

const STATES = { running: "Running", finished: "Finished", failed: "Failed", cancelled: "Cancelled" };
const LIGHTS = { running: "loading", finished: "playing", failed: "error", cancelled: "paused" };

/** `refresh` is called after a cancel. */
export function mountRun(refresh) {
  on(["studies"], show);
  $("cancel").addEventListener("click", async () => {
    try {
      await request("DELETE", "studies/running");
    } catch (problem) {
      if (problem.status !== 404) report(problem, "The study was not cancelled"); // 404: it has just ended
    }
    await refresh();
  });
}

function show({ kinds, run }) {
  $("run").hidden = !run;
  if (!run) return;
  const running = run.state === "running";
  setText($("run-title"), kinds.find(({ name }) => name === run.kind)?.title ?? run.kind);
  setText($("run-state"), running ? STATES.running : ended(run));
  $("run-state").dataset.state = LIGHTS[run.state];
  for (const id of ["run-progress", "run-figures", "cancel"]) $(id).hidden = !running;
  if (run.total) $("run-progress").value = run.done / run.total;
  else $("run-progress").removeAttribute("value");
  setText($("run-figures"), figures(run));
}

const ended = ({ state, elapsed_s, error }) =>
  `${STATES[state]} after ${duration(elapsed_s)}${error ? `: ${error}` : ""}`;

function figures({ done, total, elapsed_s, remaining_s }) {
  const parts = total ? `${done} of ${total} parts` : "Starting";
  const left = remaining_s === null ? "" : `, about ${duration(remaining_s)} left`;
  return `${parts}, ${duration(elapsed_s)} so far${left}`;
}
