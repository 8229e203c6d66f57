// Units and number texts. The API speaks SI; people read millimetres and degrees.

export const UNKNOWN = "\u2013";
export const COMPLETE_HINT =
  "Share of the revolution whose measurements arrived, with or without a return";

const FIRST_YEAR = 1990; // with lidar logs
export const DEGREE = Math.PI / 180;

/** How a field is shown: {unit, scale, digits}; shown value = SI value / scale. Small lengths go in mm. */
export function displayOf({ unit, default: preset, integer }) {
  if (/^rad\b/.test(unit))
    return { unit: unit.replace("rad", "°"), scale: DEGREE, digits: preset < 0.05 ? 3 : 1 };
  if (/^m\b/.test(unit) && preset !== null && preset < 0.1)
    return { unit: unit.replace("m", "mm"), scale: 0.001, digits: 1 };
  if (unit === "1/m") return { unit: "mm/m²", scale: 0.001, digits: 3 };
  if (/^m\b/.test(unit)) return { unit, scale: 1, digits: 3 };
  return { unit, scale: 1, digits: integer ? 0 : Math.max(3, decimals(preset) + 1) };
}

const decimals = (value) => String(value).split(".")[1]?.length ?? 0;

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Number text with a true minus sign. */
export function fixed(value, digits) {
  return Number.isFinite(value) ? value.toFixed(digits).replace("-", "\u2212") : "\u2013";
}

export const metres = (value) => fixed(value, 3);
export const millimetres = (value) => fixed(value * 1e3, Math.abs(value) < 0.1 ? 1 : 0);
export const wholeMillimetres = (value) => fixed(value * 1e3, 0);
export const degrees = (value) => fixed(value / DEGREE, 1);
export const fineDegrees = (value) => fixed(value / DEGREE, 3);
export const squareMillimetres = (value) => fixed(value * 1e6, Math.abs(value) < 1e-5 ? 1 : 0);

/** The area of an ellipse where there is little room: in mm², from 0.1 m² with two digits. */
export const ellipseArea = (value) => (value >= 0.1 ? exponential(value * 1e6) : squareMillimetres(value));

/** A ratio with three digits, as 0.95, 12.3 or 456; from 100,000 with two. */
export const ratio = (value) => (value >= 1e5 ? exponential(value) : fixed(value, value < 9.995 ? 2 : value < 99.95 ? 1 : 0));

const exponential = (value) => value.toExponential(1).replace("+", "");

/** A standard deviation of a place: in millimetres, above a metre in metres with three digits. */
export function spread(value) {
  if (!(value >= 1)) return `${millimetres(value)}\u2009mm`;
  return `${fixed(value, Math.max(0, 2 - Math.floor(Math.log10(value))))}\u2009m`;
}

/** A duration given in microseconds: three digits and a unit that fits. */
export function microseconds(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const [scaled, unit] = value < 1e3 ? [value, "µs"] : [value / 1e3, "ms"];
  return `${scaled.toFixed(scaled < 10 ? 2 : scaled < 100 ? 1 : 0)}\u2009${unit}`;
}

/** A duration given in microseconds, in milliseconds. */
export const milliseconds = (value) => (Number.isFinite(value) ? `${fixed(value / 1e3, 1)}\u2009ms` : UNKNOWN);

export const hertz = (value) => (Number.isFinite(value) ? `${fixed(value, 1)}\u2009Hz` : UNKNOWN);

/** A share of one; what is not whole is never shown as 100 %. */
export function percent(share) {
  const shown = share < 1 ? Math.min(99.9, 100 * share) : 100;
  return `${fixed(shown, shown === 100 ? 0 : 1)}\u2009%`;
}

const WHOLE = new Intl.NumberFormat("en", { maximumFractionDigits: 0 }); // made once, which takes longer than to use it

export const wholeNumber = (value) => (Number.isFinite(value) ? WHOLE.format(value) : "\u2013");

/** A time in seconds as m:ss.t. */
export function clock(seconds) {
  if (!Number.isFinite(seconds)) return "\u2013";
  const tenths = Math.round(seconds * 10);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${Math.floor(tenths / 600)}:${rest}`;
}

/** A duration in seconds as people say it: 8 s, 2 min, 1.5 h. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return UNKNOWN;
  if (seconds < 100) return `${Math.round(seconds)}\u2009s`;
  if (seconds < 6000) return `${Math.round(seconds / 60)}\u2009min`;
  return `${fixed(seconds / 3600, 1)}\u2009h`;
}

/** A stamp in seconds as a time of the day, with the date if that is another; stamps of some logs count from their start. */
export function moment(stamp) {
  const then = new Date(1e3 * stamp);
  if (then.getFullYear() < FIRST_YEAR) return `${fixed(stamp, 1)}\u2009s`;
  const time = then.toLocaleTimeString("en-GB");
  return then.toDateString() === new Date().toDateString()
    ? time
    : `${then.toLocaleDateString("en-CA")} ${time}`;
}

/** How long ago, in the largest unit that fits. */
export function ago(seconds) {
  const units = [
    [86400, "d"],
    [3600, "h"],
    [60, "min"],
    [1, "s"],
  ];
  const [size, unit] = units.find(([size]) => seconds >= size) ?? units.at(-1);
  return Number.isFinite(seconds) ? `${Math.max(0, Math.floor(seconds / size))}\u2009${unit}` : UNKNOWN;
}

/** A file size in bytes. */
export function bytes(size) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const step = size > 0 ? Math.min(units.length - 1, Math.floor(Math.log10(size) / 3)) : 0;
  const scaled = size / 1000 ** step;
  return `${scaled.toFixed(step > 0 && scaled < 10 ? 1 : 0)}\u2009${units[step]}`;
}
