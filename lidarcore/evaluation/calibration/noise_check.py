"""Does what scans show of their noise contradict the noise that is set?"""

from collections import deque

import numpy as np

from lidarcore.arrays import Array
from lidarcore.features import Features
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan

SCANS = 20  # whose median speaks: one scan's estimate is off by a tenth or so
AGREES = (1 / 1.5, 2.5)
"""Seen over expected: clutter makes it up to twice as large in real rooms whose noise is calibrated."""


def noise_expected(scan: Scan, noise: SensorNoise) -> float:
    """What `Features.noise_seen` (m) would be about, if the noise is as it is set; 0 of fewer than three returns.

    That is the scatter of a range about the mean of its neighbours. A bearing's error acts with the slope of the range,
    unevenness as far as neighbours do not share it.
    """
    rho, theta = scan.ranges[scan.valid], scan.bearings[scan.valid]
    if len(rho) < 3:
        return 0.0
    step = ((np.roll(theta, -1) - np.roll(theta, 1)) % (2 * np.pi)) / 2
    slope = (np.roll(rho, -1) - np.roll(rho, 1)) / (2 * np.maximum(step, 1e-9))
    variances = noise.range_variances(rho) + (slope * noise.sigma_bearing) ** 2
    if noise.unevenness:
        variances = variances + _of_unevenness(rho, slope, step, noise)
    return float(np.sqrt(np.median(variances)))


def _of_unevenness(rho: Array, slope: Array, step: Array, noise: SensorNoise) -> Array:
    """(N,) m², what a wall's pattern adds: of an Ornstein-Uhlenbeck process at three points, 2/3 of the variance."""
    shared = np.exp(-np.hypot(rho, slope) * step / noise.unevenness_length)
    curved = 1 - 4 / 3 * shared + shared**2 / 3
    variances: Array = noise.unevenness**2 * curved * (1 + (slope / rho) ** 2)
    return variances


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
