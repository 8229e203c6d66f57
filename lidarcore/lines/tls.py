"""The three "total least squares" of [WCTLS]: utls, wtls, wctls.

Despite the name all three solve a'x + b'y = -1 by least squares, unweighted or with inverse determinants as
weights; wctls has the estimate of wtls and another covariance. None can express a line through the sensor.
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import (
    NO_LINE,
    OK,
    THROUGH_SENSOR,
    Fit,
    Moments,
    Normal,
    Sym2,
    moments,
    weights_determinant,
)


@inlined
def fit_utls(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """Unweighted [WCTLS 1-7]."""
    w[:] = 1.0
    return _least_squares(rho, c, s, v_rho, v_theta, w, False)


@inlined
def fit_wtls(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """Weighted [WCTLS 8-15]."""
    weights_determinant(w, rho)
    return _least_squares(rho, c, s, v_rho, v_theta, w, True)


@inlined
def _least_squares(
    rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array, weighted: bool
) -> Fit:
    m = moments(w, rho, c, s)
    status, abc, normal = _implicit(m)
    if status != OK:
        return status, NO_LINE, NO_LINE
    return OK, normal, _propagate(w, rho, c, s, v_rho, v_theta, m, abc, weighted)


@inlined
def fit_wctls(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """Weighted conformal [WCTLS 16-23]: Q = (a/c, b/c), normal Q/|Q|, distance 1/|Q|."""
    weights_determinant(w, rho)
    status, _, normal = _implicit(moments(w, rho, c, s))
    if status != OK:
        return status, NO_LINE, NO_LINE
    return OK, normal, _conformal(rho, c, s, v_rho, v_theta, normal)


@inlined
def _implicit(m: Moments) -> tuple[int, tuple[float, float, float], Normal]:
    """a, b, c of [2-4, 10-12] divided by the squared sum of weights, and the normal form.

    In centred moments a = X S_yy - Y S_xy has the same value as with raw ones, without their cancellation.
    """
    _, x, y, xx, xy, yy = m
    a, b = x * yy - y * xy, y * xx - x * xy
    c = -(xx * yy - xy * xy + x * a + y * b)
    h = np.sqrt(a * a + b * b)
    r = -c / h
    # a and b are spread times distance: where they have cancelled to rounding errors, the line is not known.
    if not (r > 0 and h * h > 1e-14 * (xx + yy) ** 2 * (x * x + y * y + xx + yy)):
        return THROUGH_SENSOR, NO_LINE, NO_LINE
    return OK, (a, b, c), (a / h, b / h, r)


@inlined
def _propagate(
    w: Array,
    rho: Array,
    c: Array,
    s: Array,
    v_rho: float,
    v_theta: float,
    m: Moments,
    abc: tuple[float, float, float],
    weighted: bool,
) -> Sym2:
    """First-order covariance [6, 14] of (a, b, c), carried on to (alpha, r).

    The terms R, S [7] and T, U [15] are d(a, b, c)/drho_i and d(a, b, c)/dtheta_i. With w ~ 1/rho² the second
    moments do not depend on rho_i, and w x falls as 1/rho: this is why T_3 = 0.
    """
    w_sum, x_mean, y_mean, xx, xy, yy = m
    xx, xy, yy = xx + x_mean * x_mean, xy + x_mean * y_mean, yy + y_mean * y_mean  # raw
    a, b, k = abc
    h2 = a * a + b * b
    h = np.sqrt(h2)
    first, second = (-1.0, 0.0) if weighted else (1.0, 2.0)
    aa = ar = rr = 0.0
    for i in range(len(rho)):
        q = w[i] / w_sum
        ux, uy = q * c[i], q * s[i]
        x, y = rho[i] * c[i], rho[i] * s[i]
        # By rho: derivatives of the sums of x, y, xx, xy, yy.
        dx, dy = first * ux, first * uy
        dxx, dxy, dyy = second * ux * x, second * ux * y, second * uy * y
        da = dx * yy + x_mean * dyy - dy * xy - y_mean * dxy
        db = dy * xx + y_mean * dxx - dx * xy - x_mean * dxy
        dk = 2 * xy * dxy - dxx * yy - xx * dyy
        alpha_rho = (a * db - b * da) / h2
        r_rho = (-dk + k * (a * da + b * db) / h2) / h
        # By theta.
        dx, dy = -q * y, q * x
        dxx, dxy = -2 * q * x * y, q * (x * x - y * y)
        da = dx * yy - x_mean * dxx - dy * xy - y_mean * dxy
        db = dy * xx + y_mean * dxx - dx * xy - x_mean * dxy
        dk = 2 * xy * dxy - dxx * yy + xx * dxx
        alpha_theta = (a * db - b * da) / h2
        r_theta = (-dk + k * (a * da + b * db) / h2) / h
        aa += v_rho * alpha_rho * alpha_rho + v_theta * alpha_theta * alpha_theta
        ar += v_rho * alpha_rho * r_rho + v_theta * alpha_theta * r_theta
        rr += v_rho * r_rho * r_rho + v_theta * r_theta * r_theta
    return aa, ar, rr


@inlined
def _conformal(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, normal: Normal) -> Sym2:
    """C_Q = (sum p p^T / (|Q|² vc))^-1 through the Jacobian [23]; vc the conditional variance 1 / (n^T C^-1 n).

    Reconstructed: the paper takes C_Q from an earlier one and does not print it. Written in the frame
    of the line, where Q lies on the normal: dalpha = dQ_t / |Q|, dr = -dQ_n / |Q|², up to the common sign.
    """
    nx, ny, r = normal
    nn = nt = tt = 0.0
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        t = rho[i] * along
        d = rho[i] * across
        weight = across * across / v_rho + along * along / (v_theta * rho[i] * rho[i])
        nn += weight * d * d
        nt += weight * d * t
        tt += weight * t * t
    det = nn * tt - nt * nt  # times |Q|^4 in both: C_Q = |Q|² [[tt, -nt], [-nt, nn]] / det
    return nn / det, r * nt / det, r * r * tt / det
