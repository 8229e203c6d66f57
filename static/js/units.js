// Units and number texts. The API speaks SI; people read millimetres and degrees.

export const UNKNOWN = "\u2013";
export const COMPLETE_HINT = "Share of the turn whose measurements arrived, whether or not they have a return";

const DEGREE = Math.PI / 180;

/** How a field is shown: {unit, scale, digits}; shown value = SI value / scale. Small lengths go in mm. */
export function displayOf({ unit, default: preset, integer }) {
  if (unit === "rad") return { unit: "°", scale: DEGREE, digits: preset < 0.05 ? 3 : 1 };
  if (unit === "m" && preset < 0.1) return { unit: "mm", scale: 0.001, digits: 1 };
  if (unit === "m") return { unit: "m", scale: 1, digits: 3 };
  return { unit, scale: 1, digits: integer ? 0 : 2 };
}

/** Number text with a true minus sign. */
export function fixed(value, digits) {
  return Number.isFinite(value) ? value.toFixed(digits).replace("-", "\u2212") : "\u2013";
}

export const metres = (value) => fixed(value, 3);
export const millimetres = (value) => fixed(value * 1e3, value < 0.1 ? 1 : 0);
export const degrees = (value) => fixed(value / DEGREE, 1);
export const squareMillimetres = (value) => fixed(value * 1e6, value < 1e-5 ? 1 : 0);

/** A duration given in microseconds: three digits and a unit that fits. */
export function microseconds(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const [scaled, unit] = value < 1e3 ? [value, "µs"] : [value / 1e3, "ms"];
  return `${scaled.toFixed(scaled < 10 ? 2 : scaled < 100 ? 1 : 0)}\u2009${unit}`;
}

/** A duration given in microseconds, in milliseconds. */
export const milliseconds = (value) => `${fixed(value / 1e3, 1)}\u2009ms`;

/** A share of one; what is not whole is never shown as 100 %. */
export function percent(share) {
  const shown = share < 1 ? Math.min(99.9, 100 * share) : 100;
  return `${fixed(shown, shown === 100 ? 0 : 1)}\u2009%`;
}

export const wholeNumber = (value) =>
  Number.isFinite(value) ? Math.round(value).toLocaleString("en") : "\u2013";

/** A time in seconds as m:ss.t. */
export function clock(seconds) {
  if (!Number.isFinite(seconds)) return "\u2013";
  const tenths = Math.round(seconds * 10);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${Math.floor(tenths / 600)}:${rest}`;
}

/** A file size in bytes. */
export function bytes(size) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const step = size > 0 ? Math.min(units.length - 1, Math.floor(Math.log10(size) / 3)) : 0;
  const scaled = size / 1000 ** step;
  return `${scaled.toFixed(step > 0 && scaled < 10 ? 1 : 0)}\u2009${units[step]}`;
}
