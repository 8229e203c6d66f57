"""Gaussian mixture by expectation maximisation [EKF 5-12], by scikit-learn, and how many components there are."""

from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from lidarcore.arrays import Array, Ints
from lidarcore.noise import SensorNoise

if TYPE_CHECKING:
    from sklearn.mixture import GaussianMixture

VERY_STRONG = 10.0
"""Difference of the Bayesian information criterion that is very strong evidence (Kass and Raftery 1995)."""


def label(points: Array, k: int | None, k_max: int, noise: SensorNoise) -> Ints:
    """Most probable component (n,) of each point (n, 2) m; at most as many components as distinct points.

    Components have full covariances, and none is thinner than two standard deviations of a range, as far away as most
    points are: else they shrink to points that happen to lie in a line, and the bent face of one post becomes two.
    Without k, it is the smallest from 1 to k_max against which none has very strong evidence by the Bayesian
    information criterion (Schwarz 1978); the paper uses the elbow.
    """
    k_most = len(np.unique(points, axis=0))
    with threadpool_limits(1):  # several add up in any order and cost more than they save
        numbers = range(1, min(k_max, k_most) + 1) if k is None else [min(k, k_most)]
        floor = 4 * float(np.median(noise.range_variances(np.hypot(*points.T))))
        mixtures = [_mixture(points, k, floor) for k in numbers]
        criteria = np.array([mixture.bic(points) for mixture in mixtures])
    chosen = mixtures[int(np.argmax(criteria <= criteria.min() + VERY_STRONG))]
    return chosen.predict(points).astype(np.int64)


def _mixture(points: Array, k: int, floor: float) -> "GaussianMixture":
    from sklearn.mixture import GaussianMixture  # here, for it takes a second to import

    return GaussianMixture(k, reg_covar=floor, max_iter=1000, random_state=0).fit(points)
