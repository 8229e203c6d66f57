"""What a calibration found, said in words: what could not be told, and what the noise model does not hold."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lidarcore.evaluation.calibration.result import Calibration
from lidarcore.evaluation.calibration.variances import Bands
from lidarcore.evaluation.intervals import Interval

DIFFERENT = 0.01  # p-value below which bands are said to differ
ONE = "one number fits"


def remarks(found: Calibration, bias: Interval | None) -> tuple[str, ...]:
    """All there is to say; `bias` is the range bias (m), None if it cannot be told."""
    return (
        *_on_sigma("range", found.sigma_range, (1e3, 2, " mm")),
        *_on_sigma("bearing", found.sigma_bearing, (1e3, 2, " mrad"), (math.degrees(1), 3, "°")),
        *_on_precision(found),
        *_on_unevenness(found.unevenness, found.noise.unevenness),
        *_on_ranges(found),
        *_on_incidence(found),
        *_on_drift(found.drift, found.sigma_range),
        _on_bias(bias),
        _on_alignment(found.alignment),
    )


def differs(bands: Bands) -> bool:
    """Whether data show that the noise differs from band to band."""
    return bands.p_value < DIFFERENT


def _on_sigma(name: str, sigma: Interval, *units: tuple[float, int, str]) -> Iterator[str]:
    """A remark if sigma cannot be determined; each of the units with its factor and its digits."""
    if sigma.low <= 0:
        most = " or ".join(f"{_number(sigma.high, factor, digits)}{unit}" for factor, digits, unit in units)
        yield f"The {name} noise cannot be determined here (at most {most}): keep the current setting."


def _on_precision(found: Calibration) -> Iterator[str]:
    """Which noise is not known to within 15 % yet, and how many scans that takes."""
    names = {
        "sigma_range": "range noise",
        "sigma_bearing": "bearing noise",
        "range_growth": "growth with range",
    }
    parts = ", ".join(
        f"{needed:,} for the {names[name]}"
        for name, needed in found.scans_needed.items()
        if needed is not None and needed > found.scans
    )
    if parts:
        yield f"To know each part to within 15 %, take more scans than these {found.scans}: {parts}."


def _on_unevenness(size: Interval, assumed: float) -> Iterator[str]:
    if size.low <= 0:
        yield (
            f"The walls may as well be straight: their unevenness is at most {_number(size.high, 1e3, 1)} mm. Since "
            f"walls seldom are, {_number(assumed, 1e3, 1)} mm are assumed."
        )


def _on_ranges(found: Calibration) -> list[str]:
    """On what the growth that was fitted, if any, leaves of the differences with distance."""
    growth, bands = found.range_growth, found.by_range
    if found.noise.range_growth == 0:
        return _on_bands(bands, ONE, "distance", "nearby", "far away")
    near, far = np.square(bands.edges[:-1]), np.square(bands.edges[1:])
    left = tuple(
        Interval(
            _rest(sigma.value, growth.value * (a + b) / 2),
            _rest(sigma.low, growth.high * b),
            _rest(sigma.high, growth.low * a),
        )
        for sigma, a, b in zip(bands.sigmas, near, far, strict=True)
    )
    return _on_bands(
        replace(bands, sigmas=left), "sigma_range and range_growth fit", "distance", "nearby", "far away"
    )


def _on_incidence(found: Calibration) -> list[str]:
    """On differences with incidence; where noise grows with distance, they may be of walls that are farther away."""
    if found.noise.range_growth > 0:
        return []
    return _on_bands(found.by_incidence, ONE, "incidence", "that beams meet squarely", "that beams graze")


def _rest(sigma: float, part: float) -> float:
    """The standard deviation that is left of sigma without a part of its variance."""
    return math.sqrt(max(sigma**2 - part**2, 0))


def _on_bands(bands: Bands, fit: str, name: str, first: str, last: str) -> list[str]:
    """Whose ellipses are wrong, where the intervals of the first and the last band say so; `fit`, what fits badly."""
    if not differs(bands):
        return []
    low, *_, high = bands.sigmas
    if high.low > low.high:
        return [_badly(f"grows with {name}", fit, last)]
    if high.high < low.low:
        return [_badly(f"falls with {name}", fit, first)]
    if max(sigma.low for sigma in bands.sigmas) > min(sigma.high for sigma in bands.sigmas):
        return [f"Range noise differs with {name}: {fit} badly."]
    return []


def _badly(how: str, fit: str, where: str) -> str:
    return f"Range noise {how}: {fit} badly; ellipses of corners {where} will be too small."


def _on_drift(drift: float, sigma_range: Interval) -> Iterator[str]:
    if drift > sigma_range.value:
        yield (
            f"A wall drifted by more than the noise, by {_number(drift, 1e3, 1)} mm: was something moving, or the "
            "sensor still warming up?"
        )


def _on_bias(bias: Interval | None) -> str:
    if bias is None:
        return "The range bias cannot be determined here: it takes more, longer or straighter walls."
    if bias.contains(0):
        return f"No range bias is detected: it lies {_between(bias, 1e3, 1)} mm."
    size, way = _number(abs(bias.value), 1e3, 1), "long" if bias.value > 0 else "short"
    return (
        f"Ranges are too {way} by {size} mm ({_between(bias, 1e3, 1)} mm). A profile holds only the noise: "
        "this bias remains, and walls appear that far off."
    )


def _on_alignment(alignment: Interval | None) -> str:
    if alignment is None:
        return "The alignment cannot be determined here: too few walls are parallel or square to each other."
    value, degrees = _number(alignment.value, math.degrees(1), 2), math.degrees(1)
    return (
        f"The walls are turned by {value}° ({_between(alignment, degrees, 2)}°) against the sensor's x axis. If its "
        "housing stands square to them, this is the offset of its bearings, which shows in no other way."
    )


def _between(figure: Interval, factor: float, digits: int) -> str:
    return f"between {_number(figure.low, factor, digits)} and {_number(figure.high, factor, digits)}"


def _number(value: float, factor: float, digits: int) -> str:
    return f"{round(factor * value, digits) + 0.0:.{digits}f}".replace("-", "−")  # + 0.0: no −0.0
