// The parameters of the filter, made from the schema; few need them, so they are folded away.

import { $, el } from "./dom.js";
import { parameterRow } from "./parameters.js";
import { changeSetting } from "./actions.js";
import { on } from "./store.js";

const FILTER = "navigation.filter.";

const LABELS = { speed: "Speed at start", turn_rate: "Turn rate at start" };
const HEADINGS = { "": "Matching", odometry: "Odometry, 1σ", velocity: "Constant velocity, 1σ" };

export function mountFilter() {
  on(["fields"], (fields) => {
    const numeric = fields.filter(({ path, maximum }) => path.startsWith(FILTER) && maximum !== undefined);
    const groups = Map.groupBy(numeric, ({ path }) => path.slice(FILTER.length).split(".").at(-2) ?? "");
    const sections = [...groups].map(([name, members]) =>
      el("div", {}, el("h3", {}, HEADINGS[name] ?? name), ...members.map(row)),
    );
    $("filter")
      .querySelector("details")
      .replaceChildren($("filter").querySelector("summary"), ...sections, reset());
  });
}

const row = (field) => parameterRow({ ...field, label: LABELS[field.key] ?? field.label });

const reset = () =>
  el(
    "button",
    { type: "button", onclick: () => changeSetting("navigation.filter", null) },
    "Reset to defaults",
  );
