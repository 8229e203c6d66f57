// A simulated robot: where it drives, what it perceives, and how its odometry errs. Chosen here, then started.

import { request } from "./api.js";
import { selectRow } from "./bindings.js";
import { $, el, remake, setText } from "./dom.js";
import { merge } from "./optimistic.js";
import { parameterRow } from "./parameters.js";
import { fieldsOf } from "./schema.js";
import { attempt, open } from "./actions.js";
import { get, on, set } from "./store.js";
import { capital } from "./units.js";

const ROOT = "simulation";
const GROUPS = [
  {
    title: "Sensor",
    holds: (path) => /\.(field_of_view|max_range|noise\.sigma_\w+|mixed|dropouts)$/.test(path),
  },
  { title: "Odometry errors", holds: (path) => path.includes(".odometry.") },
  { title: "Surroundings", holds: () => true },
];

const LABELS = {
  sigma_range: "Range noise",
  sigma_bearing: "Bearing noise",
  mixed: "Mixed pixels",
  scale: "Distance error",
  track: "Rotation error",
};

const at = (object, path) => path.split(".").reduce((node, key) => node?.[key], object);

const PATH = `${ROOT}.path`;
const paths = el("select", { id: "simulation-path" });

/** What is set here and not started yet. */
const draft = {
  key: "drafts",
  value: (path) => at(get("drafts"), path),
  change(path, value) {
    const change = path.split(".").reduceRight((inner, key) => ({ [key]: inner }), value);
    set("drafts", merge(get("drafts") ?? {}, change));
  },
};

export function mountSimulation() {
  on(["panel"], (panel) => panel === "sources" && learn());
  on(["simulation"], make);
  on(["simulation", "drafts"], offerPaths);
  paths.addEventListener("change", () => draft.change(PATH, paths.value));
  on(["source", "opening"], ({ kind }, opening) => {
    setText($("simulate"), kind === ROOT ? "Restart" : "Start");
    $("simulate").setAttribute("aria-busy", String(opening?.kind === ROOT));
  });
  $("simulation").append(
    el("div", { id: "simulation-options" }),
    el("button", { type: "button", id: "simulate", onclick: simulate }, "Start"),
  );
}

/** Plays the simulation with what is set here. */
export const simulate = () => open({ kind: ROOT, settings: get("drafts")?.simulation ?? {} });

/** What can be set never changes while a server runs. */
async function learn() {
  if (get("simulation")) return;
  const options = await attempt(
    () => request("GET", "source/simulation"),
    "The simulations could not be listed",
  );
  if (options) set("simulation", options);
}

function make({ worlds, schema }) {
  const fields = fieldsOf(schema, ROOT);
  for (const { path, default: preset } of fields)
    if (draft.value(path) === undefined) draft.change(path, preset);
  const titles = worlds.map(({ name, title }) => [name, title]);
  const numeric = fields.filter(({ maximum }) => maximum !== undefined);
  const grouped = Map.groupBy(numeric, ({ path }) => GROUPS.find(({ holds }) => holds(path)));
  $("simulation-options").replaceChildren(
    selectRow("World", `${ROOT}.world`, titles, draft),
    el("div", { class: "row" }, el("label", { for: paths.id }, "Path"), paths),
    el(
      "details",
      {},
      el("summary", {}, "Sensor, odometry, people"),
      ...GROUPS.map((group) =>
        el("div", {}, el("h3", {}, group.title), ...(grouped.get(group) ?? []).map(row)),
      ),
    ),
  );
}

const row = (field) => parameterRow({ ...field, label: LABELS[field.key] ?? field.label }, { model: draft });

/** The paths of the chosen world; the first is the usual one. */
function offerPaths({ worlds }, { simulation }) {
  const { paths: names } = worlds.find(({ name }) => name === simulation.world);
  if (!names.includes(simulation.path)) return draft.change(PATH, names[0]);
  remake(paths, names, () => names.map((name) => el("option", { value: name }, capital(name))));
  paths.value = simulation.path;
}
