"""What all fitters share: weighted moments, what a fit reports, and where its line goes.

Kernels take one piece of a scan as arrays of ranges rho (N,) m and unit vectors (c, s) (N,) of the bearings, the
noise, and a weight for each point. Published formulas know the variances v_rho (m²) and v_theta (rad²) alone.
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined

# What a fit reports.
OK, NO_DIRECTION, THROUGH_SENSOR, NOT_FINITE, NOT_CONVERGED, BEYOND = range(6)

# A line as kernels write it: unit normal (2), r, and covariances of (alpha, r), four numbers each.
NORMAL, DISTANCE, LINE_PUBLISHED, LINE_CONSISTENT, LINE_MAP = 0, 2, 3, 7, 11
LINE_FIELDS = 15

Moments = tuple[float, float, float, float, float, float]
Sym2 = tuple[float, float, float]  # xx, xy, yy of a symmetric 2 x 2 matrix
Normal = tuple[float, float, float]  # unit normal and distance r >= 0 of a line
Fit = tuple[int, Normal, Sym2]  # status, line, published covariance of (alpha, r); the weights are left in w

Work = tuple[Array, Array, Array]  # scratch (N,) each: the weights, and two for covariances

NO_LINE = (0.0, 0.0, 0.0)


@inlined
def moments(w: Array, rho: Array, c: Array, s: Array) -> Moments:
    """Sum of weights, weighted means of x and y, centred moments S_xx, S_xy, S_yy divided by the sum of weights.

    Summed about a point of the piece, so that far lines keep their digits.
    """
    middle = len(rho) // 2
    x0, y0 = rho[middle] * c[middle], rho[middle] * s[middle]
    w_sum = x_sum = y_sum = xx = xy = yy = 0.0
    for i in range(len(rho)):
        x, y = rho[i] * c[i] - x0, rho[i] * s[i] - y0
        w_sum += w[i]
        x_sum += w[i] * x
        y_sum += w[i] * y
        xx += w[i] * x * x
        xy += w[i] * x * y
        yy += w[i] * y * y
    x, y = x_sum / w_sum, y_sum / w_sum
    return w_sum, x + x0, y + y0, xx / w_sum - x * x, xy / w_sum - x * y, yy / w_sum - y * y


@inlined
def weights_determinant(w: Array, rho: Array) -> None:
    """Inverse determinant of the point covariance [CWLF 3, WCTLS 8]; the constant factor cancels everywhere."""
    for i in range(len(rho)):
        w[i] = 1 / (rho[i] * rho[i])


@inlined
def total_least_squares(m: Moments) -> tuple[int, float, float, float]:
    """Status, unit normal and signed distance of the line with least squared normal distances."""
    _, x, y, xx, xy, yy = m
    spread = np.sqrt(4 * xy * xy + (yy - xx) ** 2)
    if not spread > 1e-12 * (xx + yy) or not xx + yy > 1e-24 * (x * x + y * y):
        return NO_DIRECTION, 0.0, 0.0, 0.0
    # Half the angle atan2(-2 xy, yy - xx) without the angle: the larger component from the half-angle formula.
    cos_2a, sin_2a = (yy - xx) / spread, -2 * xy / spread
    if cos_2a > 0:
        nx = np.sqrt((1 + cos_2a) / 2)
        ny = sin_2a / (2 * nx)
    else:
        ny = np.sqrt((1 - cos_2a) / 2)
        nx = sin_2a / (2 * ny)
    return OK, nx, ny, nx * x + ny * y


@inlined
def store(out: Array, normal: Normal, published: Sym2, consistent: Sym2, for_maps: Sym2) -> int:
    """Write a line to out (LINE_FIELDS,); NOT_FINITE if it, or a covariance, is not finite and positive."""
    out[NORMAL], out[NORMAL + 1], out[DISTANCE] = normal
    good = normal[2] < np.inf
    for at, (aa, ar, rr) in (
        (LINE_PUBLISHED, published),
        (LINE_CONSISTENT, consistent),
        (LINE_MAP, for_maps),
    ):
        out[at], out[at + 1], out[at + 2], out[at + 3] = aa, ar, ar, rr
        good &= aa > 0 and np.inf > aa * rr > ar * ar  # NaN and inf fail one of the comparisons
    return OK if good else NOT_FINITE
