"""Where a simulated sensor is over time: poses (N, 3) as x m, y m, heading rad at times (N,) s."""

from collections.abc import Callable

import numpy as np

from lidarcore.arrays import Array

Path = Callable[[Array], Array]

ROUND = 60.0  # s for one round of the figure of eight


def standing(times: Array) -> Array:
    """Poses on one spot of the furnished room from which many corners are in view."""
    return np.tile([7.6, 4.4, 0.0], (len(times), 1))


def wandering(times: Array) -> Array:
    """A slow figure of eight through the furnished room, from side to side and clear of the furniture."""
    phase = 2 * np.pi * times / ROUND
    return np.stack([4.6 + 2.7 * np.sin(phase), 4.0 + 0.3 * np.sin(2 * phase), 0.6 * np.sin(phase / 2)], -1)
