"""Does the sensor stand still? Seen from its corners or walls alone, whatever their covariances claim."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.evaluation.repeatability.scatter import LEAST, Observations
from lidarcore.scan import Array, Ints

RECENT = 3  # scans in which nearly all features must be new ones for a leap
_NEW = 0.75
_SIGMAS = 6.0
_LEAST = 1e-4  # m of a drift: what is the same in every scan differs by rounding


def moves(features: Observations, newest: int) -> bool:
    """Whether features seen at (R, 2) m tell of a sensor that moves; `newest` is the number of the last scan."""
    starts = features.starts
    if not len(starts):
        return False
    first, last = features.scans[starts], features.scans[np.append(starts[1:], len(features.ids)) - 1]
    stay = (3 * first <= newest) & (3 * last >= 2 * newest)
    return _leapt(first, last, newest) or _drifts(features.table, starts, stay)


def _leapt(first: Ints, last: Ints, newest: int) -> bool:
    """Nearly all features of the last scans were never seen before. What is hidden does not count."""
    if newest < LEAST:
        return False
    recent = last > newest - RECENT
    new = recent & (first > newest - RECENT)
    return bool(recent.sum() >= RECENT and new.sum() > _NEW * recent.sum())


def _drifts(xy: Array, starts: Ints, stay: NDArray[np.bool_]) -> bool:
    """Most features that stay in view lie elsewhere in their last third of sightings than in the first.

    By _SIGMAS standard errors. What came or went in the middle of the window has nothing to tell of it.
    The noise is taken from successive differences, which a slow drift hardly enters. Real sensors' errors are
    correlated from scan to scan (0.3 in real recordings), so the limit is wider than chance alone would ask for.
    """
    n = np.diff(starts, append=len(xy))
    often: Ints = np.flatnonzero(stay & (n >= LEAST))
    if not len(often):
        return False
    third, rank = np.repeat(n // 3, n), np.arange(len(xy)) - np.repeat(starts, n)
    side = np.where(rank < third, -1.0, np.where(rank >= np.repeat(n, n) - third, 1.0, 0.0))
    steps = np.diff(xy, axis=0, prepend=xy[:1])
    steps[starts] = 0.0
    shift = np.add.reduceat(side[:, None] * xy, starts, axis=0)[often] / (n // 3)[often, None]
    variance = np.add.reduceat((steps**2).sum(1), starts)[often] / (2 * (n[often] - 1))
    drifts = (shift**2).sum(1) > np.maximum(_SIGMAS**2 * variance * 2 / (n[often] // 3), _LEAST**2)
    return bool(2 * drifts.sum() > len(often))
