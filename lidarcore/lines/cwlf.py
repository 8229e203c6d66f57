"""Conditional weighted linear fitting: regression along the axis that spreads more [CWLF 20-35]."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import NO_DIRECTION, NO_LINE, OK, Fit, moments


@inlined
def fit(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """y = slope (x - x_mean) + b with inverse conditional variances of y given x as weights [22-32].

    Where y spreads more (N_1 < N_2 [20, 21]) it is x on y [33-35]: the same with the axes swapped.
    """
    swapped = not _x_spreads_more(rho, c, s)
    if swapped:
        c, s = s, c
    for i in range(len(rho)):
        w[i] = c[i] * c[i] / (v_theta * rho[i] * rho[i]) + s[i] * s[i] / v_rho  # [23], [34]
    w_sum, x_mean, b, xx, xy, _ = moments(w, rho, c, s)
    if not xx > 1e-24 * (x_mean * x_mean + b * b):
        return NO_DIRECTION, NO_LINE, NO_LINE
    slope = xy / xx  # [29]
    v_slope, v_b = 1 / (w_sum * xx), 1 / w_sum  # [31], [32], uncorrelated
    # To normal form: n = (-slope, 1) / h, r = (b - slope x_mean) / h, h = |(slope, 1)|.
    h = np.sqrt(1 + slope * slope)
    nx, ny, r = -slope / h, 1 / h, (b - slope * x_mean) / h
    alpha_slope = 1 / (h * h)
    r_slope = -x_mean / h - r * slope / (h * h)
    r_b = 1 / h
    if r < 0:
        nx, ny, r, r_slope, r_b = -nx, -ny, -r, -r_slope, -r_b
    if swapped:  # a reflection: the angle runs the other way
        nx, ny, alpha_slope = ny, nx, -alpha_slope
    published = (
        alpha_slope * alpha_slope * v_slope,
        alpha_slope * r_slope * v_slope,
        r_slope * r_slope * v_slope + r_b * r_b * v_b,
    )
    return OK, (nx, ny, r), published


@inlined
def _x_spreads_more(rho: Array, c: Array, s: Array) -> bool:
    middle = len(rho) // 2
    x0, y0 = rho[middle] * c[middle], rho[middle] * s[middle]
    x_sum = y_sum = xx = yy = 0.0
    for i in range(len(rho)):
        x, y = rho[i] * c[i] - x0, rho[i] * s[i] - y0
        x_sum += x
        y_sum += y
        xx += x * x
        yy += y * y
    return len(rho) * xx - x_sum * x_sum >= len(rho) * yy - y_sum * y_sum
