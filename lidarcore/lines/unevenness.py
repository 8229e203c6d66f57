"""Sums over all pairs of a wall's beams, whose errors by its unevenness go together: in one pass along it.

Unevenness is an Ornstein-Uhlenbeck process along the wall, with the covariance s² exp(-|t_i - t_j| / L).
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined

Free = tuple[bool, bool]
"""Whether the first and the last end of a wall are met by no other wall."""


@inlined
def resampled_sums(
    w: Array, t: Array, decay: Array, length: float, resampling: float, free: Free
) -> tuple[float, float, float]:
    """The sums of `unevenness_sums`, of what differs if beams fall elsewhere, by `resampling`, and ends change.

    With a = spacing / (2 length), and a shift of all beams that is anywhere within the spacing, the covariance of two
    such samples of one wall is that of the process times sinh(a) / a, but (1 - exp(-a)) / a of a beam with itself. What
    they do not share, summed over the neighbours, is a variance of coth(a) - 1 / a for each beam, independent: a / 3
    where beams are dense, which hardly miss anything between them, 1 where they are far apart.
    Wherever beams fall, noise brings one at either end or takes it away: it is counted as found anew, and at a free
    end the one beside it, too. Where two walls meet, both of their lines say where they end, and no more than a beam
    changes sides.
    """
    n = len(t)
    l00 = l01 = l11 = 0.0
    for i in range(n):
        before, after = max(i - 1, 0), min(i + 1, n - 1)
        a = np.abs(t[after] - t[before]) / ((after - before) * 2 * length)
        x = a * a
        langevin = min(a * (35 + x) / (105 + 10 * x), 1.0)  # a continued fraction
        v = resampling * w[i] * w[i] * langevin
        l00 += v
        l01 += v * t[i]
        l11 += v * t[i] * t[i]
    for end in (slice(0, 2 if free[0] else 1), slice(n - (2 if free[1] else 1), n)):
        e00, e01, e11 = unevenness_sums(w[end], t[end], decay[end], length)
        l00, l01, l11 = l00 + e00, l01 + e01, l11 + e11
    return l00, l01, l11


@inlined
def unevenness_sums(w: Array, t: Array, decay: Array, length: float) -> tuple[float, float, float]:
    """Sums over all i, j of a_i b_j exp(-|t_i - t_j| / length) for (a, b) = (w, w), (w, w t) and (w t, w t).

    t (N,) is in the order of the wall; decay (N,) is scratch. What is left of all beams before decays from one to the
    next: O(N) instead of O(N²).
    """
    n = len(t)
    for i in range(1, n):
        decay[i] = exp_negative(np.abs(t[i] - t[i - 1]) / length)
    p = q = 0.0
    k00, k01, k11 = w[0] * w[0], w[0] * w[0] * t[0], w[0] * w[0] * t[0] * t[0]
    for i in range(1, n):
        wt = w[i] * t[i]
        before = decay[i] * w[i - 1]
        p, q = decay[i] * p + before, decay[i] * q + before * t[i - 1]
        k00 += w[i] * (w[i] + 2 * p)
        k01 += wt * (w[i] + p) + w[i] * q
        k11 += wt * (wt + 2 * q)
    return k00, k01, k11


@inlined
def exp_negative(x: float) -> float:
    """exp(-x) for x >= 0, to 1e-11: a loop of it vectorises.

    Taylor's polynomial of exp(-y), y = x / 64 < 1/2, to the power of 64.
    """
    y = min(x, 30.0) / 64
    z = 1 - y * (1 - y / 2 * (1 - y / 3 * (1 - y / 4 * (1 - y / 5 * (1 - y / 6 * (1 - y / 7))))))
    z *= z
    z *= z
    z *= z
    z *= z
    z *= z
    return z * z
