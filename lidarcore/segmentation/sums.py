"""What is kept of a piece, so that two can be joined and judged without looking at their points again."""

import numpy as np

from lidarcore.compiled import inlined
from lidarcore.scan import Array, Ints

SUMS = 10  # number, means of x and y, S_xx, S_xy, S_yy, means of c² and c s, chi-square, sum of squares
_TRIM_FROM = 4  # intervals between points: three are left


@inlined
def sums(rho: Array, c: Array, s: Array, out: Array) -> None:
    """Number, mean x, mean y, centred S_xx, S_xy, S_yy per point, mean c², mean c s of a piece, into out."""
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
    out[0], out[1], out[2] = n, x + x0, y + y0
    out[3], out[4], out[5] = xx / n - x * x, xy / n - x * y, yy / n - y * y
    out[6], out[7] = cc / n, cs / n


@inlined
def sums_of(points: Array, first: Ints, last: Ints, m: Array, count: int, trimmed: bool) -> None:
    """Sums of each of `count` pieces into the first columns of m; trimmed, without the end points of all but the
    shortest: where a piece was split they are extremes, and often of two walls."""
    for p in range(count):
        trim = 1 if trimmed and last[p] - first[p] >= _TRIM_FROM else 0
        inside = slice(first[p] + trim, last[p] + 1 - trim)
        sums(points[0, inside], points[1, inside], points[2, inside], m[p])


@inlined
def join(a: Array, b: Array, out: Array) -> None:
    """Sums of two pieces together."""
    n = a[0] + b[0]
    p, q = a[0] / n, b[0] / n
    dx, dy = b[1] - a[1], b[2] - a[2]
    out[0] = n
    for k in range(1, 8):
        out[k] = p * a[k] + q * b[k]
    out[3] += p * q * dx * dx
    out[4] += p * q * dx * dy
    out[5] += p * q * dy * dy


@inlined
def line_of(m: Array) -> tuple[float, float, float, float]:
    """Unit normal, signed distance and mean squared residual of the best line through a piece with sums m."""
    half, dev = (m[3] + m[5]) / 2, (m[3] - m[5]) / 2
    root = np.sqrt(dev * dev + m[4] * m[4])
    # Eigenvector of the smaller eigenvalue half - root, from the row that does not cancel.
    nx, ny = (m[4], -dev - root) if dev > 0 else (dev - root, m[4])
    length = np.sqrt(nx * nx + ny * ny)
    if length == 0:
        return 1.0, 0.0, m[1], 0.0
    nx, ny = nx / length, ny / length
    return nx, ny, nx * m[1] + ny * m[2], max(half - root, 0.0)


@inlined
def residuals(m: Array, v_rho: float, v_theta: float) -> tuple[float, float]:
    """Sum of squared distances of a piece's points from its best line, and their mean effective variance.

    A short piece close by scatters more along the beams than it is wide, and its best line follows the beams:
    the small variance of that direction makes such a line expensive.
    """
    half, dev = (m[3] + m[5]) / 2, (m[3] - m[5]) / 2
    root = np.sqrt(dev * dev + m[4] * m[4])
    if root == 0:
        return 0.0, v_rho
    # n n^T = (1 - D) / 2 and t t^T = (1 + D) / 2 with D = [[dev, xy], [xy, -dev]] / root, for n^T U n and t^T M t.
    across = 0.5 * (1 - (dev * (2 * m[6] - 1) + 2 * m[4] * m[7]) / root)
    mx, my = m[1], m[2]
    along = (
        half
        + 0.5 * (mx * mx + my * my)
        + root
        + 0.5 * (dev * (mx * mx - my * my) + 2 * m[4] * mx * my) / root
    )
    return m[0] * max(half - root, 0.0), v_rho * across + v_theta * along
