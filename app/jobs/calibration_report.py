"""What a calibration found, with what it means in words: the same for the command, REST and the page."""

from dataclasses import dataclass

from lidarcore.evaluation.calibration.result import Calibration
from lidarcore.evaluation.calibration.variances import Bands
from lidarcore.evaluation.intervals import Interval

from ..records import record
from .calibration_remarks import differs, remarks

TELLING = 0.05  # m, half-width of the interval of a range bias beyond which it is not told


@dataclass(frozen=True, slots=True)
class BandsReport:
    """sigma_range (m) in bands between the edges (m, or rad of incidence), and whether data show that it differs."""

    edges: tuple[float, ...]
    sigmas: tuple[Interval, ...]
    p_value: float
    differs: bool


@dataclass(frozen=True, slots=True)
class NoiseFound:
    """m, rad and 1/m, as the settings have it; None where it cannot be told and what is set should stay.

    Growth that is not seen is 0; unevenness that is not seen is what rooms usually have of as much as could have been
    overlooked. The systematic part is none of it: from one place it is never seen.
    """

    sigma_range: float | None
    sigma_bearing: float | None
    range_growth: float
    unevenness: float
    unevenness_length: float
    tails: float
    renewal: float
    resampling: float


@dataclass(frozen=True, slots=True)
class CalibrationReport:
    """Metres and radians; noise, range_bias and alignment are None where they cannot be told. `remarks` says why."""

    noise: NoiseFound
    sigma_range: Interval
    sigma_bearing: Interval
    range_growth: Interval
    unevenness: Interval
    unevenness_length: Interval | None
    scans_needed: dict[str, int | None]
    by_range: BandsReport
    by_incidence: BandsReport
    outliers: Interval
    range_bias: Interval | None
    alignment: Interval | None
    drift: float
    walls: int
    beams: int
    remarks: tuple[str, ...]


def report(found: Calibration) -> CalibrationReport:
    """A calibration as its report: intervals, bands and remarks."""
    bias = found.range_bias
    if bias is not None and bias.half_width > TELLING:
        bias = None
    sigmas = {name: found.told[name] for name in ("sigma_range", "sigma_bearing")}
    return record(
        CalibrationReport,
        found,
        noise=record(NoiseFound, found.noise, **sigmas),
        by_range=_bands(found.by_range),
        by_incidence=_bands(found.by_incidence),
        range_bias=bias,
        remarks=remarks(found, bias),
    )


def _bands(bands: Bands) -> BandsReport:
    return BandsReport(tuple(bands.edges), tuple(bands.sigmas), bands.p_value, differs(bands))
