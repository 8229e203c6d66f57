// What is seen as a file: PNG as it is on the screen, SVG at true scale.

import { shape } from "../svg.js";

const SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
const WIDEST_MM = 297; // A4, lying
const REVOKE_MS = 10_000;

/** Gives a file to the user. */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), REVOKE_MS);
}

/** The scale 1:N, of round N, at which a look fits on a sheet. */
export function sheetScale(look) {
  const width = (1e3 * look.width) / look.scale; // mm of the floor
  return SCALES.find((scale) => width / scale <= WIDEST_MM) ?? SCALES.at(-1);
}

/** An SVG of a drawing made by `draw(pen)`, as large as the floor is at the scale. */
export function svgFile(pen, look, scale, ground) {
  const millimetres = 1e3 / (look.scale * scale); // of a pixel
  const { width, height } = look;
  const svg = shape(
    "svg",
    { xmlns: "http://www.w3.org/2000/svg", width: `${width * millimetres}mm`, height: `${height * millimetres}mm`, viewBox: `0 0 ${width} ${height}` },
    shape("title", {}, `1:${scale}`),
    shape("rect", { width, height, fill: ground }),
    ...pen.nodes,
  );
  return new Blob([new XMLSerializer().serializeToString(svg)], { type: "image/svg+xml" });
}
