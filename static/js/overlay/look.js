// How the floor of the world lies in the view: a homography from metres to pixels, so that what is drawn over the scene
// is where the scene has it, seen from above or at a slant.

import { along, axesAt } from "./framing.js";

export class Look {
  /** `matrix` takes (x, y, 1) of the floor, m, to pixels, row by row; the view is `width` by `height` pixels. */
  constructor(matrix, width, height) {
    this.matrix = matrix;
    this.width = width;
    this.height = height;
    this.inverse = inverted(matrix);
  }

  /** The pixel of a place [x, y] on the floor; null if it lies behind the eye. */
  toScreen(place) {
    const [x, y, depth] = applied(this.matrix, place);
    return depth > 0 ? [x / depth, y / depth] : null;
  }

  /** The place on the floor below a pixel; null above the horizon. */
  toFloor(pixel) {
    const [x, y, w] = applied(this.inverse, pixel);
    const place = [x / w, y / w];
    return this.toScreen(place) && place;
  }

  /** Pixels per metre in the middle of the view. */
  get scale() {
    const middle = [this.width / 2, this.height / 2];
    const [a, b] = [middle, [middle[0] + 1, middle[1]]].map((pixel) => this.toFloor(pixel));
    return a && b ? 1 / Math.hypot(b[0] - a[0], b[1] - a[1]) : NaN;
  }

  /** The same look on a sheet that is `factor` times as large. */
  enlarged(factor) {
    const matrix = this.matrix.map((value, at) => (at < 6 ? factor * value : value));
    return new Look(matrix, factor * this.width, factor * this.height);
  }
}

const applied = (m, [x, y]) => [0, 3, 6].map((row) => m[row] * x + m[row + 1] * y + m[row + 2]);

function inverted([a, b, c, d, e, f, g, h, i]) {
  const adjugate = [
    e * i - f * h, c * h - b * i, b * f - c * e,
    f * g - d * i, a * i - c * g, c * d - a * f,
    d * h - e * g, b * g - a * h, a * e - b * d,
  ];
  const determinant = a * adjugate[0] + b * adjugate[3] + c * adjugate[6];
  return adjugate.map((value) => value / determinant);
}

/** A camera of our own, for as long as the scene has none: the floor from above, dragged and zoomed by the pointer. */
export class PlainCamera {
  #held = null; // {middle, scale} as someone moved it; null while all is kept in the view
  #wanted = { middle: [0, 0], half: 5, up: Math.PI / 2 }; // as framing.js has it

  /** `size()` tells the view's {width, height} in pixels. */
  constructor(size) {
    this.size = size;
  }

  fit(framing) {
    if (framing) this.#wanted = framing;
    this.#held = null;
  }

  look(framing) {
    this.#wanted = framing;
    if (this.#held && framing.isFollowed) this.#held.middle = framing.middle;
  }

  floorToWindow() {
    const { width, height } = this.size();
    const { middle, scale, axes: [right, up] } = this.#state();
    return [
      ...right.map((part) => scale * part), width / 2 - scale * along(right, middle),
      ...up.map((part) => -scale * part), height / 2 + scale * along(up, middle),
      0, 0, 1,
    ];
  }

  /** Moves what is seen by so many pixels. */
  drag(dx, dy) {
    this.#move(-dx, dy, 1);
  }

  /** Enlarges what is seen; the pixel given stays where it is. */
  zoom([X, Y], factor) {
    const { width, height } = this.size();
    const [right, up] = [X - width / 2, height / 2 - Y].map((way) => way * (1 - 1 / factor));
    this.#move(right, up, factor);
  }

  /** Goes so many pixels to the right and up, and enlarges. */
  #move(right, up, factor) {
    const { middle, scale, axes } = this.#state();
    const moved = middle.map((at, i) => at + (right * axes[0][i] + up * axes[1][i]) / scale);
    this.#held = { middle: moved, scale: factor * scale };
  }

  #state() {
    const { middle, half, up } = this.#wanted;
    const held = this.#held ?? { middle, scale: this.size().height / (2 * half) };
    return { ...held, axes: axesAt(up) };
  }
}
