// Clusters: the method, those of the parameters that it uses, and what it costs.

import { segmentedRow, switchRow } from "./bindings.js";
import { $, el, setText } from "./dom.js";
import { parameterRow } from "./parameters.js";
import { on } from "./store.js";
import { microseconds } from "./units.js";

const OF_ALL = ["min_points", "max_range"]; // parameters that every method has

const LABELS = {
  min_points: "Fewest points",
  k: "Clusters, k",
  k_max: "Most clusters",
  eps: "Eps",
  max_range: "Max range",
};
const EMPTY = { k: "auto", max_range: "none" };

export function mountClusters() {
  on(["clusterers", "fields"], make);
  on(["clusterers", "fields", "settings"], describe);
  on(["frame", "clusterers", "fields"], ({ clusters, timings }) =>
    setText(
      $("cluster-cost"),
      clusters
        ? `${clusters.length} in this scan, found in ${microseconds(timings.cluster_us)}.`
        : "Computed only while they are shown or used as landmarks.",
    ),
  );
}

function make(clusterers, fields) {
  const numeric = fields.filter(({ path, maximum }) => /^clusters\.\w+$/.test(path) && maximum !== undefined);
  $("clusters").replaceChildren(
    $("clusters").querySelector("h2"),
    switchRow("Show them in the scene", "view.layers.clusters"),
    segmentedRow(
      "Method",
      "clusters.method",
      clusterers.map(({ name, title }) => [name, title]),
      {
        class: "row segmented wide",
        "aria-describedby": "clusterer-about",
      },
    ),
    el("p", { class: "muted about", id: "clusterer-about" }),
    ...numeric.map(row),
    el("p", { class: "muted", id: "cluster-cost" }),
  );
}

function row(field) {
  const labelled = { ...field, label: LABELS[field.key] ?? field.label };
  const node = parameterRow(labelled, { empty: EMPTY[field.key] });
  node.dataset.parameter = field.key;
  return node;
}

function describe(clusterers, fields, { clusters }) {
  const { summary, reference, parameters } = clusterers.find(({ name }) => name === clusters.method);
  setText($("clusterer-about"), `${summary} Source: ${reference}.`);
  for (const node of $("clusters").querySelectorAll("[data-parameter]")) {
    const { parameter } = node.dataset;
    node.hidden =
      ![...parameters, ...OF_ALL].includes(parameter) || (parameter === "k_max" && clusters.k !== null);
  }
}
