"""The figures of a study of consistency as people read them: columns of tables, on the terminal and in the report."""

import math

from lidarcore.evaluation.intervals import Interval
from lidarcore.noise import SensorNoise

COLUMNS = {
    "found": ("found", 1.0, 3),
    "bias": ("bias mm", 1e3, 2),
    "rms": ("RMS mm", 1e3, 2),
    "rms_ratio": ("RMS / bound", 1.0, 3),
    "coverage_50": ("in 50 %", 1.0, 3),
    "coverage_95": ("in 95 %", 1.0, 3),
    "coverage_99": ("in 99 %", 1.0, 3),
    "anees": ("ANEES", 1.0, 2),
    "area_ratio": ("area", 1.0, 3),
}
"""Heading, factor and digits of each figure."""


def cell(figure: Interval, factor: float, digits: int) -> str:
    """A figure and half of its interval; what may as well be 0 as its upper end; a dash where there is nothing."""
    low, value, high = (factor * x for x in (figure.low, figure.value, figure.high))
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(high - low):
        return f"{value:.{digits}f}"
    if not low > 0:
        return f"< {high:.{digits}f}"
    return f"{value:.{digits}f} ±{(high - low) / 2:.{digits}f}".replace("±0.", "±.")


def noise_text(noise: SensorNoise) -> str:
    """'2 cm, 1 mrad'."""
    return f"{100 * noise.sigma_range:g} cm, {1e3 * noise.sigma_bearing:g} mrad"
