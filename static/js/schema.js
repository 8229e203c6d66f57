// The settings' JSON schema as a flat list of fields: {path, key, label, description, default, minimum,
// above (exclusive minimum), maximum, unit, integer, options}. The page makes its controls from these.

/** Lists the leaves of the schema in their order. */
export function fieldsOf(schema) {
  const defaults = schema.default ?? {};
  return leaves(schema, schema, defaults, []);
}

function leaves(root, node, fallback, path) {
  const resolved = resolve(root, node);
  const preset = resolved.default ?? fallback;
  if (!resolved.properties) return [leaf(resolved, preset, path)];
  return Object.entries(resolved.properties).flatMap(([key, child]) =>
    leaves(root, child, preset?.[key], [...path, key]),
  );
}

/** Follows $ref and the single member of allOf; what stands beside the reference wins. */
function resolve(root, node) {
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
    default: preset,
    minimum: node.minimum,
    above: node.exclusiveMinimum,
    maximum: node.maximum,
    unit: node.unit ?? "",
    integer: node.type === "integer",
    options: node.enum ?? [],
  };
}

const labelOf = (key) => capital(key.replaceAll("_", " "));
const sentence = (text) => text && capital(text) + (text.endsWith(".") ? "" : ".");
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
