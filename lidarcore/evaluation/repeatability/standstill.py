"""Does the sensor stand still? Seen from its corners or walls alone, whatever their covariances claim."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.evaluation.repeatability.observations import Observations
from lidarcore.evaluation.repeatability.scatter import LEAST

RECENT = 3  # scans in which nearly all features must be new ones for a leap
_NEW = 0.75
_SIGMAS = 6.0
_LEAST = 1e-4  # m of a drift: what is the same in every scan differs by rounding


def moves(features: Observations, newest: int) -> bool:
    """Whether features seen at (R, 2) m tell of a sensor that moves; `newest` is the number of the last scan."""
    return bool(_moves(features.table, features.scans, np.append(features.starts, len(features.ids)), newest))


@kernel
def _moves(xy: Array, scans: Ints, ends: Ints, newest: int) -> bool:
    """Whether the sensor leapt, or most features that stay in view drift. Observations of feature k begin at ends[k].

    What came or went in the middle of the window has nothing to tell of a drift.
    """
    recent, new, often, drifting = 0, 0, 0, 0
    for k in range(len(ends) - 1):
        first, last = scans[ends[k]], scans[ends[k + 1] - 1]
        if last > newest - RECENT:
            recent += 1
            new += first > newest - RECENT
        if 3 * first <= newest and 3 * last >= 2 * newest and ends[k + 1] - ends[k] >= LEAST:
            often += 1
            drifting += _drifts(xy[ends[k] : ends[k + 1]])
    return _leapt(recent, new, newest) or 2 * drifting > often


@inlined
def _leapt(recent: int, new: int, newest: int) -> bool:
    """Nearly all features of the last scans were never seen before. What is hidden does not count."""
    return newest >= LEAST and recent >= RECENT and new > _NEW * recent


@inlined
def _drifts(xy: Array) -> bool:
    """Whether a feature (n, 2) m lies elsewhere in its last third of observations than in the first.

    By _SIGMAS standard errors. The noise is taken from successive differences, which a slow drift hardly enters. Real
    sensors' errors are correlated from scan to scan (0.3 in real recordings), so the limit is wider than chance alone
    would ask for.
    """
    n, third = len(xy), len(xy) // 3
    shift = steps = 0.0
    for axis in range(2):
        x = xy[:, axis]
        shift += (x[n - third :].mean() - x[:third].mean()) ** 2
        for i in range(1, n):
            steps += (x[i] - x[i - 1]) ** 2
    variance = steps / (2 * (n - 1))
    return shift > max(_SIGMAS**2 * variance * 2 / third, _LEAST**2)
