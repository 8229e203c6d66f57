"""Objects by the gaps between them: the text of [EKF 1]; the formula has the sensor in the place of a neighbour."""

import numpy as np

from lidarcore.arrays import Array, Ints


def label(points: Array, distance: float) -> Ints:
    """Object (n,) of each point (n, 2) m; a new one where a point is farther than distance (m) from the one before.

    The points go around a ring: the first one comes after the last.
    """
    gaps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
    starts = gaps > distance
    # What comes before the first start belongs to the last object.
    return np.cumsum(starts) % max(int(starts.sum()), 1)
