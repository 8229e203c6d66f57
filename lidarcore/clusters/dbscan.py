"""Density-based clusters [EKF 13], by scikit-learn."""

import numpy as np

from lidarcore.arrays import Array, Ints


def label(points: Array, eps: float, min_points: int) -> Ints:
    """Cluster (n,) of each point (n, 2) m, -1 for noise.

    A point with min_points within eps (m), itself included, is dense; dense points within eps of each other
    are one cluster, to which other points within eps of them belong, too.
    """
    from sklearn.cluster import DBSCAN  # here, for it takes a second to import

    return DBSCAN(eps=eps, min_samples=min_points).fit_predict(points).astype(np.int64)
