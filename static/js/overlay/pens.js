// Two ways to put the same drawing down: on a canvas, and into an SVG. All is in pixels; colours are CSS colours.

import { shape } from "../svg.js";

const FONT = '"Plex", system-ui, sans-serif';
const SIZE = 12; // px, of text

export class CanvasPen {
  constructor(context) {
    this.context = context;
  }

  /** A line through points; `fill` is a colour, too. */
  path(points, { stroke, width = 1.5, dash = [], fill, closed = false, opacity = 1 }) {
    if (points.length < 2) return;
    const { context } = this;
    context.beginPath();
    points.forEach(([x, y], at) => (at ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (closed) context.closePath();
    this.#ink({ stroke, width, dash, fill, opacity });
  }

  disc([x, y], radius, { stroke, width = 1.5, fill, opacity = 1 }) {
    this.context.beginPath();
    this.context.arc(x, y, radius, 0, 2 * Math.PI);
    this.#ink({ stroke, width, dash: [], fill, opacity });
  }

  text([x, y], words, { fill, halo, anchor = "start" }) {
    const { context } = this;
    context.font = `${SIZE}px ${FONT}`;
    context.textAlign = anchor === "middle" ? "center" : anchor;
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.setLineDash([]);
    context.strokeStyle = halo;
    context.strokeText(words, x, y);
    context.fillStyle = fill;
    context.fillText(words, x, y);
  }

  #ink({ stroke, width, dash, fill, opacity }) {
    const { context } = this;
    context.globalAlpha = opacity;
    if (fill) {
      context.fillStyle = fill;
      context.fill();
    }
    if (stroke) {
      context.strokeStyle = stroke;
      context.lineWidth = width;
      context.setLineDash(dash);
      context.stroke();
    }
    context.globalAlpha = 1;
  }
}

export class SvgPen {
  constructor() {
    this.nodes = [];
  }

  path(points, { stroke = "none", width = 1.5, dash = [], fill = "none", closed = false, opacity = 1 }) {
    if (points.length < 2) return;
    const d = `M${points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L")}${closed ? "Z" : ""}`;
    this.#add("path", { d, stroke, "stroke-width": width, "stroke-dasharray": dash.join(" "), fill, opacity });
  }

  disc([cx, cy], r, { stroke = "none", width = 1.5, fill = "none", opacity = 1 }) {
    this.#add("circle", { cx, cy, r, stroke, "stroke-width": width, fill, opacity });
  }

  text([x, y], words, { fill, halo, anchor = "start" }) {
    const look = { "font-family": FONT, "font-size": SIZE, "paint-order": "stroke", "stroke-width": 3 };
    this.#add("text", { x, y, fill, stroke: halo, "text-anchor": anchor, ...look }, words);
  }

  #add(tag, attributes, ...children) {
    this.nodes.push(shape(tag, attributes, ...children));
  }
}
