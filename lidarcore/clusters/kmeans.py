"""k-means [EKF 2-4], by scikit-learn, and how many means there are."""

import numpy as np
from threadpoolctl import threadpool_limits

from lidarcore.arrays import Array, Ints

HALVED_WALL = 2 - 1.25 * np.log(3)
"""Mean silhouette of the two halves of a straight wall evenly covered with points, 0.627: they are one object."""


def label(points: Array, k: int | None, k_max: int) -> Ints:
    """Nearest mean (n,) of each point (n, 2) m; at most as many means as there are distinct points.

    Without k, it is that from 2 to k_max with the largest mean silhouette (Rousseeuw 1987). The silhouette is not
    defined for one cluster: there is one unless the clusters are better separated than the halves of a straight wall.
    """
    k_most = len(np.unique(points, axis=0))
    with threadpool_limits(1):  # several add up in any order and cost more than they save
        if k is not None:
            return _partition(points, min(k, k_most))
        candidates = [_partition(points, k) for k in range(2, min(k_max, k_most, len(points) - 1) + 1)]
        scores = [_silhouette(points, labels) for labels in candidates]
    if max(scores, default=0.0) <= HALVED_WALL:
        return np.zeros(len(points), np.int64)
    return candidates[int(np.argmax(scores))]


def _partition(points: Array, k: int) -> Ints:
    from sklearn.cluster import KMeans  # here, for it takes a second to import

    return KMeans(k, n_init=4, tol=0, random_state=0).fit_predict(points).astype(np.int64)


def _silhouette(points: Array, labels: Ints) -> float:
    from sklearn.metrics import silhouette_score

    return float(silhouette_score(points, labels))
