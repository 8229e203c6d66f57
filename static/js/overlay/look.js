// How the floor of the world lies in the view: a homography from metres to pixels, so that what is drawn over the scene
// is where the scene has it, seen from above or at a slant.

const MARGIN = 1.08; // around a room that is looked at

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
  #x = 0;
  #y = 0;
  #scale = null; // px/m; null while the room is kept in the view
  #room = [[-5, 5], [-5, 5]];

  constructor(stage) {
    this.stage = stage;
  }

  fit(extent) {
    if (extent) this.#room = extent;
    this.#scale = null;
  }

  follow(extent) {
    this.#room = extent;
  }

  floorToWindow() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    const { x, y, scale } = this.#state();
    return [scale, 0, width / 2 - scale * x, 0, -scale, height / 2 + scale * y, 0, 0, 1];
  }

  /** Moves what is seen by so many pixels. */
  drag(dx, dy) {
    const { x, y, scale } = this.#state();
    this.#hold(x - dx / scale, y + dy / scale, scale);
  }

  /** Enlarges what is seen; the pixel given stays where it is. */
  zoom([X, Y], factor) {
    const { clientWidth: width, clientHeight: height } = this.stage;
    const { x, y, scale } = this.#state();
    const [right, up] = [X - width / 2, height / 2 - Y].map((way) => (way / scale) * (1 - 1 / factor));
    this.#hold(x + right, y + up, factor * scale);
  }

  #hold(x, y, scale) {
    [this.#x, this.#y, this.#scale] = [x, y, scale];
  }

  #state() {
    if (this.#scale !== null) return { x: this.#x, y: this.#y, scale: this.#scale };
    const { clientWidth: width, clientHeight: height } = this.stage;
    const [x, y] = this.#room.map(([low, high]) => ({ centre: (low + high) / 2, size: high - low }));
    const scale = Math.min(width / x.size, height / y.size) / MARGIN;
    return { x: x.centre, y: y.centre, scale };
  }
}
