"""Does what scans show of their noise contradict the noise that is set?"""

from collections import deque

import numpy as np

from lidarcore.features import Features
from lidarcore.noise import SensorNoise
from lidarcore.segmentation.noise_expected import noise_expected

SCANS = 20  # whose median speaks: one scan's estimate is off by a tenth or so
AGREES = (1 / 1.5, 2.5)
"""Seen over expected: clutter makes it up to twice as large in real rooms whose noise is calibrated."""


def contradiction(seen: float, expected: float) -> str | None:
    """Says in words that the noise seen (m) is not what is expected (m); None if it is."""
    if not expected or AGREES[0] <= seen / expected <= AGREES[1]:
        return None
    return f"Ranges scatter by {1e3 * seen:.0f} mm, set to {1e3 * expected:.0f}."


class NoiseCheck:
    """Told of the features of every scan; of another source, or with another noise, it starts again."""

    def __init__(self) -> None:
        self._of: tuple[int, SensorNoise] | None = None
        self._seen: deque[tuple[float, float]] = deque(maxlen=SCANS)

    def observe(self, found: Features, source: int) -> str | None:
        """The contradiction after this scan, in words; None if there is none, or before there have been SCANS."""
        noise = found.settings.noise
        if self._of != (source, noise):
            self._of = source, noise
            self._seen.clear()
        self._seen.append((found.noise_seen, noise_expected(found.scan, noise)))
        if len(self._seen) < SCANS:
            return None
        seen, expected = np.median(self._seen, axis=0).tolist()
        return contradiction(seen, expected)
