"""What a calibration found, as JSON and in words: the same for the command, REST and the page."""

import math
from dataclasses import asdict
from typing import Literal, cast

from typing_extensions import TypedDict

from lidarcore.evaluation.calibration import Calibration
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.variances import Bands

DIFFERENT = 0.01  # p-value below which bands are said to differ
TELLING = 0.05  # m, half-width of the interval of a range bias beyond which it says nothing


class IntervalJson(TypedDict):
    """A figure and the ends of its 95 % confidence interval."""

    value: float
    low: float
    high: float


class BandsJson(TypedDict):
    """sigma_range (m) in bands between the edges (m, or rad of incidence), and whether data show that it differs."""

    edges: list[float]
    sigmas: list[IntervalJson]
    p_value: float
    differs: bool


class NoiseJson(TypedDict):
    """m and rad, as the settings have it."""

    sigma_range: float
    sigma_bearing: float


class CalibrationJson(TypedDict):
    """Metres and radians; range_bias and alignment are null where they cannot be told. `remarks` says it in words."""

    noise: NoiseJson
    sigma_range: IntervalJson
    sigma_bearing: IntervalJson
    by_range: BandsJson
    by_incidence: BandsJson
    outliers: IntervalJson
    range_bias: IntervalJson | None
    alignment: IntervalJson | None
    drift: float
    walls: int
    beams: int
    remarks: list[str]


State = Literal["idle", "collecting", "calculating", "done", "failed"]


class CalibrationStateJson(TypedDict):
    """How far it is: `scans` of `wanted` from a source; `message` says what it waits for, or what went wrong."""

    state: State
    source: str | None
    scans: int
    wanted: int
    message: str | None
    result: CalibrationJson | None


def calibration_json(found: Calibration) -> CalibrationJson:
    """All of it."""
    return {
        "noise": {"sigma_range": found.noise.sigma_range, "sigma_bearing": found.noise.sigma_bearing},
        "sigma_range": _interval(found.sigma_range),
        "sigma_bearing": _interval(found.sigma_bearing),
        "by_range": _bands(found.by_range),
        "by_incidence": _bands(found.by_incidence),
        "outliers": _interval(found.outliers),
        "range_bias": None if found.range_bias is None else _interval(found.range_bias),
        "alignment": None if found.alignment is None else _interval(found.alignment),
        "drift": found.drift,
        "walls": found.walls,
        "beams": found.beams,
        "remarks": [
            *_on_bearing(found.sigma_bearing),
            _on_bias(found.range_bias),
            _on_alignment(found.alignment),
        ],
    }


def _interval(figure: Interval) -> IntervalJson:
    return cast(IntervalJson, asdict(figure))


def _bands(bands: Bands) -> BandsJson:
    return {
        "edges": list(bands.edges),
        "sigmas": [_interval(sigma) for sigma in bands.sigmas],
        "p_value": bands.p_value,
        "differs": bands.p_value < DIFFERENT,
    }


def _on_bearing(sigma: Interval) -> list[str]:
    if sigma.low > 0:
        return []
    most = _number(sigma.high, 1e3, 2)
    return [f"The bearing noise cannot be told from 0 here, and may be up to {most} mrad."]


def _on_bias(bias: Interval | None) -> str:
    if bias is None or bias.half_width > TELLING:
        return "A range bias cannot be told here: that takes more, longer or straighter walls."
    if bias.contains(0):
        return f"No range bias is seen: it lies {_between(bias, 1e3, 1)} mm."
    size, way = _number(abs(bias.value), 1e3, 1), "long" if bias.value > 0 else "short"
    return (
        f"Ranges are too {way} by {size} mm ({_between(bias, 1e3, 1)} mm). A profile holds the noise only: this stays, "
        "and walls are as far off."
    )


def _on_alignment(alignment: Interval | None) -> str:
    if alignment is None:
        return "The alignment cannot be told here: too few walls are parallel or square to each other."
    value, degrees = _number(alignment.value, math.degrees(1), 2), math.degrees(1)
    return (
        f"The walls are turned by {value}° ({_between(alignment, degrees, 2)}°) against the sensor's x axis. If its "
        "housing stands square to them, this is the offset of its bearings, which shows in no other way."
    )


def _between(figure: Interval, factor: float, digits: int) -> str:
    return f"between {_number(figure.low, factor, digits)} and {_number(figure.high, factor, digits)}"


def _number(value: float, factor: float, digits: int) -> str:
    return f"{round(factor * value, digits) + 0.0:.{digits}f}".replace("-", "−")  # + 0.0: no −0.0
