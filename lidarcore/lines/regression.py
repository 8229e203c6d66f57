"""What all fitters share: weighted moments, and the first-order covariance of a weighted regression.

Kernels take one piece of a scan as arrays of ranges rho (N,) m and unit vectors (c, s) (N,) of the bearings,
the variances v_rho (m²) and v_theta (rad²) of the noise, and a weight for each point.
"""

import numpy as np

from lidarcore.compiled import inlined
from lidarcore.lines.line import Array

# What a fit reports.
OK, NO_DIRECTION, THROUGH_SENSOR, NOT_FINITE = 0, 1, 2, 3

Moments = tuple[float, float, float, float, float, float]
Sym2 = tuple[float, float, float]  # xx, xy, yy of a symmetric 2 x 2 matrix
Normal = tuple[float, float, float]  # unit normal and distance r >= 0 of a line
Fit = tuple[int, Normal, Sym2]  # status, line, published covariance of (alpha, r); the weights are left in w

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
def consistent_covariance(
    w: Array, rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, normal: Normal
) -> Sym2:
    """Sandwich covariance of (alpha, r) for a regression with weights w.

    To first order every fitter here minimises sum w (e + dalpha t - dr)², e the distance of a point from the line
    and t its coordinate along it; they differ by w only. With A the normal matrix and B the same sum
    weighted by w² v, v the effective variance, the covariance is A^-1 B A^-1.
    """
    nx, ny, _ = normal
    a0 = a1 = a2 = b0 = b1 = b2 = 0.0
    middle = len(rho) // 2
    t0 = rho[middle] * (nx * s[middle] - ny * c[middle])
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        t = rho[i] * along
        v = v_rho * across * across + v_theta * t * t
        t -= t0
        wwv = w[i] * w[i] * v
        a0 += w[i]
        a1 += w[i] * t
        a2 += w[i] * t * t
        b0 += wwv
        b1 += wwv * t
        b2 += wwv * t * t
    mean = a1 / a0
    d = a2 - a1 * mean  # sum of w (t - mean)^2
    # Moments of w² v about the mean, then G = (dalpha, dr at the mean); dr at t = 0 adds mean * dalpha.
    b2 = b2 - 2 * mean * b1 + mean * mean * b0
    b1 = b1 - mean * b0
    mean += t0
    v_alpha = b2 / (d * d)
    cov_alpha_m = -b1 / (a0 * d)
    return (
        v_alpha,
        cov_alpha_m + mean * v_alpha,
        b0 / (a0 * a0) + 2 * mean * cov_alpha_m + mean * mean * v_alpha,
    )


@inlined
def store(out: Array, normal: Normal, published: Sym2, consistent: Sym2) -> int:
    """Write a line to out: unit normal, r, and both covariances of (alpha, r); NOT_FINITE if one is not positive."""
    out[0], out[1], out[2] = normal
    out[3], out[4], out[5], out[6] = published[0], published[1], published[1], published[2]
    out[7], out[8], out[9], out[10] = consistent[0], consistent[1], consistent[1], consistent[2]
    # NaN and inf fail one of the comparisons.
    good = (
        published[0] > 0
        and consistent[0] > 0
        and np.inf > published[0] * published[2] > published[1] * published[1]
        and np.inf > consistent[0] * consistent[2] > consistent[1] * consistent[1]
        and normal[2] < np.inf
    )
    return OK if good else NOT_FINITE
