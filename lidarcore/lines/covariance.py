"""How far off a line is: first-order covariances of a weighted regression under the noise of beams and walls.

Errors of beams are independent, a wall's unevenness is not.
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import Normal, Sym2, Work
from lidarcore.lines.unevenness import Free, exp_negative, resampled_sums, unevenness_sums
from lidarcore.noise import NoiseModel

_PRIOR_WEIGHT = 4.0  # of a room's unevenness against the independent stretches of one wall
# variances: a residual, or a step between neighbours, counts for no more in what is a wall's own
_GROSS = 9.0
_ROUGH_WEIGHT = 16.0  # of the roughness expected against the beams of one wall
_SMOOTHEST = 0.25  # of the variance expected: ranges may also be alike because the sensor smooths them

_NOTHING: Sym2 = (0.0, 0.0, 0.0)

Regression = tuple[float, float, float]  # sum of weights, weighted mean of t, centred second moment of t


@inlined
def covariances(
    work: Work, rho: Array, c: Array, s: Array, noise: NoiseModel, normal: Normal, robust: bool, free: Free
) -> tuple[Sym2, Sym2]:
    """Sandwich covariances of (alpha, r) for a regression with the weights work[0]: of repetition, and of truth.

    To first order every fitter here minimises sum w (e + dalpha t - dr)², e the distance of a point from the line
    and t its coordinate along it; they differ by w only. With A the normal matrix and B the same sum weighted by
    w² v, v the effective variance, the covariance is A^-1 B A^-1. Robust weights of Student's t widen it.

    work is scratch behind the weights; free says whether the first and the last end are met by no other wall.
    """
    w = work[0]
    nx, ny, _ = normal
    a0 = a1 = a2 = b0 = b1 = b2 = 0.0
    middle = len(rho) // 2
    t0 = rho[middle] * (nx * s[middle] - ny * c[middle])
    for i in range(len(rho)):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        t = rho[i] * along
        square = rho[i] * rho[i]
        v = (noise.v_rho + noise.growth * square * square) * across * across + noise.v_theta * t * t
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
    white = (b2 / (d * d), -b1 / (a0 * d), b0 / (a0 * a0))
    if robust:
        white = (white[0] + noise.widened / d, white[1], white[2] + noise.widened / a0)
    if noise.v_wall == 0 and noise.v_systematic == 0:
        here = _at_sensor(white, mean)
        return here, here
    pattern, elsewhere, roughness, off = _pattern(work, rho, c, s, noise, normal, (a0, mean, d), white, free)
    anew, same = _plus(white, 1.0, pattern), _plus(white, 1.0, elsewhere)
    repeated = _plus(_plus(_NOTHING, (1 - noise.renewal) * roughness, same), noise.renewal, anew)
    half, t_m = off
    tilt = noise.v_systematic / (half * half)
    lever = t_m - mean  # of the wall's middle, about which it is tilted
    systematic = (tilt, lever * tilt, noise.v_systematic + lever * lever * tilt)
    return _at_sensor(repeated, mean), _at_sensor(_plus(anew, 1.0, systematic), mean)


@inlined
def _plus(a: Sym2, share: float, b: Sym2) -> Sym2:
    """a + share b"""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@inlined
def _at_sensor(about_mean: Sym2, mean: float) -> Sym2:
    """Of (alpha, r) from that of (alpha, height of the line over t = mean)."""
    aa, am, mm = about_mean
    return aa, am + mean * aa, mm + 2 * mean * am + mean * mean * aa


@inlined
def _pattern(
    work: Work,
    rho: Array,
    c: Array,
    s: Array,
    noise: NoiseModel,
    normal: Normal,
    sums: Regression,
    white: Sym2,
    free: Free,
) -> tuple[Sym2, Sym2, float, tuple[float, float]]:
    """Covariances of (alpha, height over the mean) by this wall's unevenness: of all of it, and of what beams that fall
    elsewhere on it make of it; its roughness; half its length and its middle (m).

    Roughness is by how much neighbouring beams differ, over the variance expected of that: some walls, and beams at
    some incidence, are far noisier than others in one room.
    """
    w, t, decay = work
    nx, ny, r = normal
    a0, mean, d = sums
    n = len(rho)
    residual = expected = steps = v_before = e_before = 0.0
    for i in range(n):
        across, along = nx * c[i] + ny * s[i], nx * s[i] - ny * c[i]
        at = r * along / across - mean
        t[i] = at
        e = rho[i] * across - r
        square = rho[i] * rho[i]
        v = (noise.v_rho + noise.growth * square * square) * across * across + noise.v_theta * (
            at + mean
        ) ** 2
        residual += w[i] * min(e * e, _GROSS * (v + noise.v_wall))
        expected += w[i] * v
        if i > 0:
            alike = exp_negative(np.abs(at - t[i - 1]) / noise.length)
            step, of_step = e - e_before, v + v_before + 2 * noise.v_wall * (1 - alike)
            steps += min(step * step / of_step, _GROSS)
        v_before, e_before = v, e
    k00, k01, k11 = unevenness_sums(w, t, decay, noise.length)
    # The wall's own variance, from what its residuals have beyond the beams' noise; a line takes out a part of both.
    seen = residual - (expected - white[2] * a0 - white[0] * d)
    of_wall = a0 - k00 / a0 - k11 / d
    stretches = a0 * a0 / k00
    own = max(seen / of_wall, 0.0) if of_wall > 0.01 * a0 else noise.v_wall
    told = max(stretches - 2.0, 0.0)
    v_wall = (_PRIOR_WEIGHT * noise.v_wall + told * own) / (_PRIOR_WEIGHT + told)
    pattern = _gained(v_wall, k00, k01, k11, a0, d)
    elsewhere = pattern
    if noise.renewal < 1:
        l00, l01, l11 = resampled_sums(w, t, decay, noise.length, noise.resampling, free)
        elsewhere = _gained(v_wall, l00, l01, l11, a0, d)
    roughness = max((steps * n / (n - 1) + _ROUGH_WEIGHT) / (n + _ROUGH_WEIGHT), _SMOOTHEST)
    return pattern, elsewhere, roughness, (np.abs(t[n - 1] - t[0]) / 2, (t[n - 1] + t[0]) / 2 + mean)


@inlined
def _gained(v: float, k00: float, k01: float, k11: float, a0: float, d: float) -> Sym2:
    """Covariance of (alpha, height over the mean), by sums over errors of variance v."""
    return v * k11 / (d * d), -v * k01 / (a0 * d), v * k00 / (a0 * a0)
