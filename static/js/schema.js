// The settings' JSON schema as a flat list of fields: {path, key, label, description, default, minimum,
// above (exclusive minimum), maximum, unit, integer, nullable, options}. The page makes its controls from these.

import { capital } from "./units.js";

/** Lists the leaves of the schema in their order, their paths beginning with `root`, if there is one. */
export function fieldsOf(schema, root = null) {
  const defaults = schema.default ?? {};
  return leaves(schema, schema, defaults, root ? [root] : []);
}

function leaves(root, node, fallback, path) {
  const resolved = resolve(root, node);
  const preset = fallback ?? resolved.default; // what the whole says of its parts comes first
  if (!resolved.properties) return [leaf(resolved, preset, path)];
  return Object.entries(resolved.properties).flatMap(([key, child]) =>
    leaves(root, child, preset?.[key], [...path, key]),
  );
}

/** Follows $ref, the single member of allOf, and what may be left empty; what stands beside it wins. */
function resolve(root, node) {
  if (node.anyOf) {
    const { anyOf, ...beside } = node;
    const full = anyOf.find(({ type }) => type !== "null");
    return { ...resolve(root, full), ...beside, nullable: anyOf.length > 1 };
  }
  const reference = node.$ref ?? node.allOf?.[0]?.$ref;
  if (!reference) return node;
  const target = reference
    .replace(/^#\//, "")
    .split("/")
    .reduce((at, key) => at[key], root);
  const { $ref, allOf, ...beside } = node;
  return { ...resolve(root, target), ...beside };
}

function leaf(node, preset, path) {
  const key = path.at(-1);
  return {
    path: path.join("."),
    key,
    label: labelOf(key),
    description: sentence(node.description ?? ""),
    default: preset ?? null,
    minimum: node.minimum,
    above: node.exclusiveMinimum,
    maximum: node.maximum,
    unit: node.unit ?? "",
    integer: node.type === "integer",
    nullable: node.nullable ?? false,
    options: node.enum ?? [],
  };
}

const labelOf = (key) => capital(key.replaceAll("_", " "));
const sentence = (text) => text && capital(text) + (text.endsWith(".") ? "" : ".");
