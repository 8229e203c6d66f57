"""Moments of the points of a piece, so that two can be joined and judged without looking at their points again."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined
from lidarcore.noise import NoiseModel

# Columns: number of points, means of x and y, centred second moments per point, means of c² and c s, and what the
# best line leaves: the sum of squared distances, and the same in variances.
COUNT, X, Y, XX, XY, YY, CC, CS, SQUARES, CHI2 = range(10)
MOMENTS = 10
_TRIM_FROM = 4  # intervals between points: three are left


@inlined
def moments(rho: Array, c: Array, s: Array, out: Array) -> None:
    """Moments of a piece, all but what its line leaves, into out."""
    middle = len(rho) // 2
    x0, y0 = rho[middle] * c[middle], rho[middle] * s[middle]
    x_sum = y_sum = xx = xy = yy = cc = cs = 0.0
    for i in range(len(rho)):
        x, y = rho[i] * c[i] - x0, rho[i] * s[i] - y0
        x_sum += x
        y_sum += y
        xx += x * x
        xy += x * y
        yy += y * y
        cc += c[i] * c[i]
        cs += c[i] * s[i]
    n = len(rho)
    x, y = x_sum / n, y_sum / n
    out[COUNT], out[X], out[Y] = n, x + x0, y + y0
    out[XX], out[XY], out[YY] = xx / n - x * x, xy / n - x * y, yy / n - y * y
    out[CC], out[CS] = cc / n, cs / n


@inlined
def moments_of(points: Array, first: Ints, last: Ints, m: Array, count: int, trimmed: bool) -> None:
    """Moments of each of `count` pieces, all but what its line leaves, into m.

    trimmed  without the end points of all but the shortest: where a piece was split they are extremes, and often of
             two walls
    """
    for p in range(count):
        trim = 1 if trimmed and last[p] - first[p] >= _TRIM_FROM else 0
        inside = slice(first[p] + trim, last[p] + 1 - trim)
        moments(points[0, inside], points[1, inside], points[2, inside], m[p])


@inlined
def copy(row: Array, out: Array) -> None:
    """Copy a row entry by entry: an assignment of whole rows compiles a check of their shapes, which takes seconds."""
    for i in range(MOMENTS):
        out[i] = row[i]


@inlined
def join(a: Array, b: Array, out: Array) -> None:
    """Moments of two pieces together, all but what their line leaves."""
    n = a[COUNT] + b[COUNT]
    p, q = a[COUNT] / n, b[COUNT] / n
    dx, dy = b[X] - a[X], b[Y] - a[Y]
    out[COUNT] = n
    for k in range(X, CS + 1):
        out[k] = p * a[k] + q * b[k]
    out[XX] += p * q * dx * dx
    out[XY] += p * q * dx * dy
    out[YY] += p * q * dy * dy


@inlined
def line_of(m: Array) -> tuple[float, float, float, float]:
    """Unit normal, signed distance and mean squared residual of the best line through a piece with moments m."""
    half, dev = (m[XX] + m[YY]) / 2, (m[XX] - m[YY]) / 2
    root = np.sqrt(dev * dev + m[XY] * m[XY])
    # Eigenvector of the smaller eigenvalue half - root, from the row that does not cancel.
    nx, ny = (m[XY], -dev - root) if dev > 0 else (dev - root, m[XY])
    length = np.sqrt(nx * nx + ny * ny)
    if length == 0:
        return 1.0, 0.0, m[X], 0.0
    nx, ny = nx / length, ny / length
    return nx, ny, nx * m[X] + ny * m[Y], max(half - root, 0.0)


@inlined
def judge(m: Array, noise: NoiseModel) -> None:
    """Write what the best line of a piece leaves of it."""
    m[SQUARES], variance = residuals(m, noise)
    m[CHI2] = m[SQUARES] / variance


@inlined
def residuals(m: Array, noise: NoiseModel) -> tuple[float, float]:
    """Sum of squared distances of a piece's points from its best line, and their mean effective variance.

    A short piece close by scatters more along the beams than it is wide, and its best line follows the beams:
    the small variance of that direction makes such a line expensive. Unevenness is alike in neighbours: sums of it
    over many points grow as if its variance were larger by their number in 2 L.
    """
    half, dev = (m[XX] + m[YY]) / 2, (m[XX] - m[YY]) / 2
    root = np.sqrt(dev * dev + m[XY] * m[XY])
    if root == 0:
        return 0.0, noise.v_rho + noise.v_wall
    mx, my = m[X], m[Y]
    # n n^T = (1 - D) / 2 and t t^T = (1 + D) / 2 with D = [[dev, xy], [xy, -dev]] / root, for n^T U n and t^T M t.
    across = 0.5 * (1 - (dev * (2 * m[CC] - 1) + 2 * m[XY] * m[CS]) / root)
    along = (
        half
        + 0.5 * (mx * mx + my * my)
        + root
        + 0.5 * (dev * (mx * mx - my * my) + 2 * m[XY] * mx * my) / root
    )
    v_rho = noise.v_rho + noise.growth * (mx * mx + my * my) ** 2
    variance = v_rho * across + noise.v_theta * along
    if noise.v_wall > 0:
        spacing = np.sqrt(12 * (half + root)) / m[COUNT]  # of points spread evenly along the piece
        variance += noise.v_wall * min(1 + 2 * noise.length / spacing, m[COUNT])
    return m[COUNT] * max(half - root, 0.0), variance
