"""White noise beside walls that may be rough between neighbouring beams: what no scatter tells apart."""

from dataclasses import replace

import numpy as np
from scipy.special import erfcx

from lidarcore.evaluation.calibration.white import Scatter, White, white_parts
from lidarcore.evaluation.intervals import Interval
from lidarcore.scan import Array

_ROUNDS = 8
_AGREE = 1e-3
_LEAST = 0.05  # of a variance: so much is noise, however rough the wall


def smooth_or_rough(scatter: Scatter, smooth: White, size: Interval, length: Interval | None) -> White:
    """Values of sigma_range, range_growth and sigma_bearing as `white_parts` finds them, with wider intervals.

    It takes walls for smooth over the centimetre by which an error of the bearing shifts a beam, as real ones mostly
    are. On an Ornstein-Uhlenbeck process of size and length (m) neighbours would scatter by the wall's pattern, too.
    The intervals hold for the one, the other and what lies between, up to the shortest length that is likely.
    """
    if length is None or size.low <= 0:
        return smooth
    found = [
        smooth,
        *(_on_rough_walls(scatter, smooth, size.value, scale) for scale in (length.value, length.low)),
    ]
    range_, growth, bearing = (
        Interval(parts[0].value, min(part.low for part in parts), max(part.high for part in parts))
        for parts in zip(*found, strict=True)
    )
    return range_, growth, bearing


def _on_rough_walls(scatter: Scatter, smooth: White, size: float, length: float) -> White:
    """What is left to white noise by the pattern, which depends on the bearing noise that is found."""
    found, sigma_bearing = smooth, smooth[2].value
    for _ in range(_ROUNDS):
        pattern = _pattern(scatter, size, length, sigma_bearing)
        left = np.maximum(scatter.variances - pattern, _LEAST * scatter.variances)
        found = white_parts(replace(scatter, variances=left))
        change = found[2].value - sigma_bearing
        if abs(change) <= _AGREE * sigma_bearing:
            break
        sigma_bearing += change / 2
    return found


def _pattern(scatter: Scatter, size: float, length: float, sigma_bearing: float) -> Array:
    """(M,) m², half of the mean squared difference of the pattern where two beams of the same bearing truly end.

    Their distance d on the wall is Gaussian; of exp(-|d| / length) the mean is a scaled complementary error function.
    """
    cosine = np.cos(scatter.incidence)
    apart = sigma_bearing * scatter.ranges / cosine  # standard deviation of d over the root of 2
    pattern: Array = (size / cosine) ** 2 * (1 - erfcx(apart / length))
    return pattern
