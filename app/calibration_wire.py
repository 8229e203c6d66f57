"""What a calibration found, as JSON and in words: the same for the command, REST and the page."""

import math
from dataclasses import asdict
from typing import Literal, cast

from typing_extensions import TypedDict

from lidarcore.evaluation.calibration import Calibration
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.variances import Bands

DIFFERENT = 0.01  # p-value below which bands are said to differ
TELLING = 0.05  # m, half-width of the interval of a range bias beyond which it is not told


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


class ToldJson(TypedDict):
    """m and rad, as the settings have it; null where it cannot be told and what is set should stay."""

    sigma_range: float | None
    sigma_bearing: float | None


class CalibrationJson(TypedDict):
    """Metres and radians; noise, range_bias and alignment are null where they cannot be told. `remarks` says why."""

    noise: ToldJson
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
    sigma_range, sigma_bearing = found.told
    bias = found.range_bias
    if bias is not None and bias.half_width > TELLING:
        bias = None
    return {
        "noise": {"sigma_range": sigma_range, "sigma_bearing": sigma_bearing},
        "sigma_range": _interval(found.sigma_range),
        "sigma_bearing": _interval(found.sigma_bearing),
        "by_range": _bands(found.by_range),
        "by_incidence": _bands(found.by_incidence),
        "outliers": _interval(found.outliers),
        "range_bias": None if bias is None else _interval(bias),
        "alignment": None if found.alignment is None else _interval(found.alignment),
        "drift": found.drift,
        "walls": found.walls,
        "beams": found.beams,
        "remarks": [
            *_on_sigma("range", found.sigma_range, (1e3, 2, " mm")),
            *_on_sigma("bearing", found.sigma_bearing, (1e3, 2, " mrad"), (math.degrees(1), 3, "°")),
            *_on_bands(found.by_range, "distance", "nearby", "far away"),
            *_on_bands(found.by_incidence, "incidence", "that beams meet squarely", "that beams graze"),
            *_on_drift(found.drift, found.sigma_range),
            _on_bias(bias),
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
        "differs": _differs(bands),
    }


def _differs(bands: Bands) -> bool:
    return bands.p_value < DIFFERENT


def _on_sigma(name: str, sigma: Interval, *units: tuple[float, int, str]) -> list[str]:
    """Each of the units with its factor and its digits."""
    if sigma.low > 0:
        return []
    most = " or ".join(f"{_number(sigma.high, factor, digits)}{unit}" for factor, digits, unit in units)
    return [f"The {name} noise cannot be told here (at most {most}): the one that is set should stay."]


def _on_bands(bands: Bands, name: str, first: str, last: str) -> list[str]:
    """Whose ellipses are wrong, where the intervals of the first and the last band say so."""
    if not _differs(bands):
        return []
    low, *_, high = bands.sigmas
    if high.low > low.high:
        return [_badly(f"grows with {name}", last)]
    if high.high < low.low:
        return [_badly(f"falls with {name}", first)]
    return [f"Range noise differs with {name}: one number fits badly."]


def _badly(how: str, where: str) -> str:
    return f"Range noise {how}: one number fits badly; ellipses of corners {where} will be too small."


def _on_drift(drift: float, sigma_range: Interval) -> list[str]:
    if drift <= sigma_range.value:
        return []
    return [
        f"A wall drifted by more than the noise, by {_number(drift, 1e3, 1)} mm: was something moving, or the sensor "
        "still warming up?"
    ]


def _on_bias(bias: Interval | None) -> str:
    if bias is None:
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
