"""Maximum likelihood on the ranges: the fitter the papers do not have.

A wall with normal n at distance r is met at rho(theta) = r / cos(theta - alpha): the regressors cos and sin of the
bearing carry no range noise, which is what biases regressions on (x, y).
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import (
    NO_LINE,
    NOT_CONVERGED,
    OK,
    THROUGH_SENSOR,
    Fit,
    Normal,
    Sym2,
    Work,
)
from lidarcore.noise import NoiseModel

_STEPS = 50
# chi-square of the last step: the line moves by less than a millionth of its standard deviation
_CONVERGED = 1e-12
_NEAR_ENOUGH = 1e-6  # the same with robust weights, which change from step to step and converge slowly
_FARTHEST = 4.0  # standard deviations: a bearing is not sought farther off


@inlined
def fit(rho: Array, c: Array, s: Array, noise: NoiseModel, work: Work) -> Fit:
    """Gauss-Newton from the least-squares line, all variances evaluated at the fit, not at the noisy points.

    work is scratch; the weights that the fit amounts to are left in it.
    """
    status, normal = _start(rho, c, s)
    if status != OK:
        return status, NO_LINE, NO_LINE
    shifts = work[0]
    shifts[:] = 0.0
    enough = _CONVERGED if noise.tails == 0 else _NEAR_ENOUGH
    for _ in range(_STEPS):
        status, normal, moved = _step(rho, c, s, noise, normal, shifts)
        if status != OK:
            return status, NO_LINE, NO_LINE
        if moved < enough:
            return OK, normal, _information_inverse(rho, c, s, noise, normal, work[0])
    return NOT_CONVERGED, NO_LINE, NO_LINE


@inlined
def _start(rho: Array, c: Array, s: Array) -> tuple[int, Normal]:
    """The least-squares line q . (x, y) = 1 (utls)."""
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
        return THROUGH_SENSOR, NO_LINE
    qx, qy = (yy * bx - xy * by) / det, (xx * by - xy * bx) / det
    q = np.sqrt(qx * qx + qy * qy)
    return OK, (qx / q, qy / q, 1 / q)


@inlined
def _step(
    rho: Array, c: Array, s: Array, noise: NoiseModel, normal: Normal, shifts: Array
) -> tuple[int, Normal, float]:
    """One Gauss-Newton step: status, line, and how far it moved as a chi-square.

    A beam's true bearing is its reported one and an unknown shift delta, whose own likeliest value for this line is
    known in closed form to first order: with J = d rho / d theta at theta + delta,

        delta <- J v_theta / (v_rho + J² v_theta) (rho - rho_hat + J delta)

    and what is left to the line is rho - rho_hat + J delta with the variance v_rho + J² v_theta. Times cos² of the
    incidence that is e, a distance from the wall, at t along it, and its variance v; here e, t and v come multiplied
    by cos, cos and cos², which takes one division instead of three. Student's weights are (1 + tails) / (v + tails e²).
    Without latent bearings delta stays 0.
    """
    nx, ny, r = normal
    most = _FARTHEST * np.sqrt(noise.v_theta)
    free = noise.v_theta if noise.latent else 0.0
    r2 = r * r
    grown, v_t, tails = noise.growth * r2 * r2, noise.v_theta * r2, noise.tails
    a0 = a1 = a2 = b0 = b1 = 0.0
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        delta = shifts[i]
        turned = 1 - 0.5 * delta * delta
        across, along = turned * across - delta * along, turned * along + delta * across
        t, square = r * along, across * across
        e = across * (rho[i] * across - r) + t * delta
        v = square * (noise.v_rho * square + noise.v_wall) + v_t * along * along + grown
        w = 1 / (v + tails * e * e)
        shifts[i] = min(max(free * w * t * e, -most), most)
        a0 += w * square
        a1 += w * across * t
        a2 += w * t * t
        b0 += w * across * e
        b1 += w * t * e
    det = a0 * a2 - a1 * a1
    if not det > 1e-13 * a0 * a2:
        return THROUGH_SENSOR, NO_LINE, 0.0
    turn, shift = (a1 * b0 - a0 * b1) / det, (a2 * b0 - a1 * b1) / det
    if not r + shift > 0:
        return THROUGH_SENSOR, NO_LINE, 0.0
    moved = a2 * turn * turn - 2 * a1 * turn * shift + a0 * shift * shift
    # Turned by the angle whose tangent is `turn`.
    length = np.sqrt(1 + turn * turn)
    return OK, ((nx - turn * ny) / length, (ny + turn * nx) / length, r + shift), moved


@inlined
def _information_inverse(rho: Array, c: Array, s: Array, noise: NoiseModel, normal: Normal, w: Array) -> Sym2:
    """Covariance of (alpha, r) by the noise of beams alone: inverse Fisher information at the fit.

    There the coordinate along the line is t = r tan(angle of incidence). w is left as the inverse variance of each
    beam about the wall's line, the weight that this fit amounts to.
    """
    nx, ny, r = normal
    middle = len(rho) // 2
    t0 = r * (nx * s[middle] - ny * c[middle]) / (nx * c[middle] + ny * s[middle])
    r2 = r * r
    grown, v_t = noise.growth * r2 * r2, noise.v_theta * r2
    a0 = a1 = a2 = 0.0
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        square, t = (
            across * across,
            r * along - t0 * across,
        )  # t times cos of the incidence, as v comes times cos²
        information = 1 / (noise.v_rho * square * square + v_t * along * along + grown)
        w[i] = information * square
        a0 += w[i]
        a1 += information * across * t
        a2 += information * t * t
    if noise.v_wall > 0:
        for i in range(len(rho)):
            w[i] = w[i] / (1 + noise.v_wall * w[i])
    mean = a1 / a0
    v_alpha = 1 / (a2 - a1 * mean)
    mean += t0
    return v_alpha, mean * v_alpha, 1 / a0 + mean * mean * v_alpha
