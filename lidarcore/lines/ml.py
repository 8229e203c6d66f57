"""Maximum likelihood on the ranges: the fitter the papers do not have.

A wall with normal n at distance r gives rho(theta) = 1 / (q . u(theta)), q = n / r, u = (cos theta, sin theta):
the regressors u carry no range noise, which is what biases regressions on (x, y).
"""

import numpy as np

from lidarcore.compiled import inlined
from lidarcore.lines.line import Array
from lidarcore.lines.regression import NO_LINE, NOT_FINITE, OK, THROUGH_SENSOR, Fit, Normal, Sym2

_STEPS = 12
# Squared relative step of q at which to stop; the error left is smaller by the relative noise.
_CONVERGED = 1e-16


@inlined
def fit(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """Gauss-Newton on rho_i - 1 / (q . u_i), the variances evaluated at the fit, not at the noisy point."""
    # Start: inverse range is linear in q; weights rho² make it the least-squares line a'x + b'y = 1 (utls).
    xx = xy = yy = bx = by = 0.0
    for i in range(len(rho)):
        x, y = rho[i] * c[i], rho[i] * s[i]
        xx += x * x
        xy += x * y
        yy += y * y
        bx += x
        by += y
    det = xx * yy - xy * xy
    if not det > 1e-13 * (xx + yy) ** 2:
        return THROUGH_SENSOR, NO_LINE, NO_LINE
    qx, qy = (yy * bx - xy * by) / det, (xx * by - xy * bx) / det
    for _ in range(_STEPS):
        status, dx, dy = _step(rho, c, s, v_rho, v_theta, qx, qy)
        if status != OK:
            return status, NO_LINE, NO_LINE
        qx, qy = qx + dx, qy + dy
        if dx * dx + dy * dy < _CONVERGED * (qx * qx + qy * qy):
            break
    else:
        return NOT_FINITE, NO_LINE, NO_LINE
    q = np.sqrt(qx * qx + qy * qy)
    normal = (qx / q, qy / q, 1 / q)
    return OK, normal, _information_inverse(rho, c, s, v_rho, v_theta, normal, w)


@inlined
def _step(
    rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, qx: float, qy: float
) -> tuple[int, float, float]:
    """One Gauss-Newton step. With g = q . u: drho/dq = -u / g², drho/dtheta = -(q . u') / g²."""
    xx = xy = yy = bx = by = 0.0
    for i in range(len(rho)):
        g, g_theta = qx * c[i] + qy * s[i], qy * c[i] - qx * s[i]
        g2 = g * g
        weight = 1 / (v_rho * g2 * g2 + v_theta * g_theta * g_theta)
        e = weight * (g - rho[i] * g2)
        xx += weight * c[i] * c[i]
        xy += weight * c[i] * s[i]
        yy += weight * s[i] * s[i]
        bx += e * c[i]
        by += e * s[i]
    det = xx * yy - xy * xy
    if not det > 1e-13 * (xx + yy) ** 2:
        return THROUGH_SENSOR, 0.0, 0.0
    return OK, (yy * bx - xy * by) / det, (xx * by - xy * bx) / det


@inlined
def _information_inverse(
    rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, normal: Normal, w: Array
) -> Sym2:
    """Covariance of (alpha, r): inverse Fisher information at the fit, where the beams meet the line.

    There the coordinate along the line is t = r tan(angle of incidence); w is left as the inverse effective
    variance of each beam, the weight that this fit amounts to.
    """
    nx, ny, r = normal
    middle = len(rho) // 2
    t0 = r * (nx * s[middle] - ny * c[middle]) / (nx * c[middle] + ny * s[middle])
    a0 = a1 = a2 = 0.0
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        t = r * along / across
        w[i] = 1 / (v_rho * across * across + v_theta * t * t)
        t -= t0
        a0 += w[i]
        a1 += w[i] * t
        a2 += w[i] * t * t
    mean = a1 / a0
    v_alpha = 1 / (a2 - a1 * mean)
    mean += t0
    return v_alpha, mean * v_alpha, 1 / a0 + mean * mean * v_alpha
