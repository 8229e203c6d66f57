"""Where a simulated sensor is over time: poses (N, 3) as x m, y m, heading rad at times (N,) s."""

from collections.abc import Callable

import numpy as np

from lidarcore.scan import Array

Path = Callable[[Array], Array]

ROUND = 60.0  # s for one round of the figure of eight


def standing(times: Array) -> Array:
    """On one spot in the middle of the furnished room."""
    return wandering(np.zeros_like(times))


def wandering(times: Array) -> Array:
    """A slow figure of eight in the middle of the furnished room, clear of the furniture."""
    phase = 2 * np.pi * times / ROUND
    return np.stack([4.5 + np.sin(phase), 4.0 + 0.6 * np.sin(2 * phase), 0.6 * np.sin(phase / 2)], -1)
