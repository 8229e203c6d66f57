"""Statistical tests that fail by chance, with other random numbers, once in a million times at most."""

import numpy as np
from scipy.stats import binom, norm

from lidarcore.evaluation.intervals import Interval

RATE = 1e-6  # of false alarms, of one assertion
SURE = float(norm.isf(RATE / 2))  # 4.9 standard errors of a Gaussian estimate
_STRETCH = SURE / float(norm.isf(0.025))


def holds(interval: Interval, truth: float) -> bool:
    """Whether a 95 % interval, stretched to the error that a Gaussian estimate has once in a million times, holds this.

    So it catches with even odds an error of 2.5 times its half width.
    """
    below, above = interval.value - interval.low, interval.high - interval.value
    return interval.value - _STRETCH * below <= truth <= interval.value + _STRETCH * above


def fewest(trials: int, share: float) -> int:
    """Hits that independent trials of this share fall short of once in a million times."""
    return int(binom.ppf(RATE, trials, share))


def band(share: float, trials: float) -> float:
    """How far a share of independent trials is off once in a million times, for shares that a Gaussian describes."""
    return float(SURE * np.sqrt(share * (1 - share) / trials))
