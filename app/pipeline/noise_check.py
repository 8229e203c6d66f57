"""Checks, from scan to scan, whether the noise that is seen contradicts the noise that is set."""

from collections import deque

import numpy as np

from lidarcore import Features, SensorNoise
from lidarcore.evaluation.calibration.noise_check import contradiction, noise_expected

SCANS = 20  # whose median speaks: one scan's estimate is off by a tenth or so


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
