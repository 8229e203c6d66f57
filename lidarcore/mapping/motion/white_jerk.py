"""How far white jerk makes a motion differ from a steady acceleration, in what sweeps show of it.

With place, speed and acceleration at time 0 given, an impulse of jerk at time u adds (t - u)² / 2 to every place
beyond it. All that sweeps show are integrals of places, so what it adds to these is a piecewise polynomial in u; jerk
that is white adds covariances, the integrals of their products [Rasmussen & Williams 2006, eq. 2.23].
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel

STRETCHES = 6
"""Of the time around a sweep: until the middle of the one before it, and from there until it begins; its own first
half, and its second one; on to the middle of the next one, and all that is later."""
_EARLY, _BEFORE, _FIRST, _SECOND, _AFTER, _LATE = range(STRETCHES)
_AT, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # exact for products of two quartic polynomials


@kernel
def wander(t: Array, h: Array, added: Array) -> None:
    """Writes covariances (T, STRETCHES, K + 2, K + 2) of what white jerk of density 1 in each of the stretches adds to
    what sweeps show: K mean places, m; the speed, m/s; and the bend, m/s².

    Mean places are those of sweeps around t (T, K) s, each h (T,) s before and after. Speed and bend are of the sweep
    around 0 s: the slope of the line through it, and by how much a steady acceleration would have to be higher for the
    sweep to begin where it begins, seen from its mean place.
    """
    K = t.shape[1]
    edges, one = np.empty(2 * K + 3), np.empty(K + 2)
    for k in range(len(t)):
        beside = np.inf
        for i in range(K):
            if t[k, i] != 0:
                beside = min(beside, abs(t[k, i]))
            edges[i], edges[K + i] = max(abs(t[k, i]) - h[k], 0.0), abs(t[k, i]) + h[k]
        edges[2 * K], edges[2 * K + 1], edges[2 * K + 2] = 0.0, h[k], beside if beside < np.inf else h[k]
        edges.sort()
        added[k] = 0.0
        for e in range(len(edges) - 1):
            middle, half = (edges[e + 1] + edges[e]) / 2, (edges[e + 1] - edges[e]) / 2
            if half > 0:
                for side in (-1.0, 1.0):
                    covariance = added[k, _stretch(middle, side, h[k], beside)]
                    for g in range(len(_AT)):
                        _add(t[k], h[k], middle + half * _AT[g], side, one)
                        for i in range(K + 2):
                            for j in range(K + 2):
                                covariance[i, j] += half * _WEIGHTS[g] * one[i] * one[j]


@kernel
def _stretch(u: float, side: float, h: float, beside: float) -> int:
    """Which stretch u s after 0 s (side 1) or before (-1) lies in; the nearest sweep is `beside` s away."""
    if u >= beside:
        return _EARLY if side < 0 else _LATE
    if u < h:
        return _FIRST if side < 0 else _SECOND
    return _BEFORE if side < 0 else _AFTER


@kernel
def _add(t: Array, h: float, u: float, side: float, added: Array) -> None:
    """What an impulse of jerk at u s, after 0 s (side 1) or before (-1), adds to what sweeps show."""
    K, d = len(t), max(h - u, 0.0)
    for i in range(K):
        added[i] = side * (max(side * t[i] + h - u, 0.0) ** 3 - max(side * t[i] - h - u, 0.0) ** 3) / (12 * h)
    added[K] = 1.5 * (u * d**3 / 6 + d**4 / 8) / h**3
    begin, mean = (-(d**2) / 2 if side < 0 else 0.0), side * d**3 / (12 * h)
    added[K + 1] = 3 * (begin - mean) / h**2
