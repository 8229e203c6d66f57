"""How noisy the ranges of a scan should seem, by the noise of its sensor and the walls that it met."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan


def noise_expected(scan: Scan, noise: SensorNoise) -> float:
    """What `Features.noise_seen` (m) would be about, if the noise is as it is set; 0 if no three returns tell it.

    That is the scatter of a range about the mean of its neighbours. A bearing's error acts with the slope of the range,
    unevenness as far as neighbours do not share it.
    """
    rho, theta = scan.ranges[scan.valid], scan.bearings[scan.valid]
    if len(rho) < 3:
        return 0.0
    step = ((np.roll(theta, -1) - np.roll(theta, 1)) % (2 * np.pi)) / 2
    slope = (np.roll(rho, -1) - np.roll(rho, 1)) / (2 * np.maximum(step, 1e-9))
    # No number holds the squares of ranges that are absurd.
    with np.errstate(over="ignore", invalid="ignore"):
        variances = noise.range_variances(rho) + (slope * noise.sigma_bearing) ** 2
        if noise.unevenness:
            variances = variances + _of_unevenness(rho, slope, step, noise)
    told = variances[np.isfinite(variances)]
    return float(np.sqrt(np.median(told))) if len(told) else 0.0


def _of_unevenness(rho: Array, slope: Array, step: Array, noise: SensorNoise) -> Array:
    """(N,) m², what a wall's pattern adds: of an Ornstein-Uhlenbeck process at three points, 2/3 of the variance."""
    shared = np.exp(-np.hypot(rho, slope) * step / noise.unevenness_length)
    curved = 1 - 4 / 3 * shared + shared**2 / 3
    variances: Array = noise.unevenness**2 * curved * (1 + (slope / rho) ** 2)
    return variances
