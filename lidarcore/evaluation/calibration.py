"""The noise of a sensor from scans it took while it stood still: sigma_range, sigma_bearing, outliers."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.intervals import Interval, share
from lidarcore.evaluation.variances import Bands, variance_model
from lidarcore.extraction import extract
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Ints, Scan
from lidarcore.settings import ExtractionSettings

LEAST_SCANS = 10
BANDS = 4  # of range and of incidence, each with as many beams
LEAST_BINS = 3 * BANDS
STILL = 0.03  # m, a wall that moves more is not seen by a sensor at rest
BIN = np.radians(1.0)  # in which a wall may be off its line by any amount, if it is so in every scan
_TRIM = 2  # beams left out at both ends of a wall, where they may be mixed
_OUTLIER = 6.0  # robust sigmas
_MAD = 1.4826  # standard deviation of a Gaussian over its median absolute deviation


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the scatter from scan to scan says about one beam. Intervals are of 95 % confidence.

    sigma_range      m, if it is the same everywhere
    sigma_bearing    rad
    by_range         sigma_range (m) in bands of range (m)
    by_incidence     sigma_range (m) in bands of the angle (rad) between beam and normal of the wall
    outliers         share of beams farther off than noise explains
    drift            m, from the first third of the scans to the last, of the wall that moved most: it adds to
                     sigma_range
    walls, beams     how many it was made of
    """

    sigma_range: Interval
    sigma_bearing: Interval
    by_range: Bands
    by_incidence: Bands
    outliers: Interval
    drift: float
    walls: int
    beams: int

    @property
    def noise(self) -> SensorNoise:
        """For the settings of extraction; at least 0.1 mm and 0.01 mrad, where nothing could be seen."""
        return SensorNoise(max(self.sigma_range.value, 1e-4), max(self.sigma_bearing.value, 1e-5))


@dataclass(frozen=True, slots=True, eq=False)
class _Beams:
    """Beams (N,) on walls, the walls' lines as they are at the bearings reported.

    error m, of the range; lever m, rho tan(incidence); ranges m; incidence rad, >= 0; scan, wall, bin: numbers.
    """

    error: Array
    lever: Array
    ranges: Array
    incidence: Array
    scan: Ints
    wall: Ints
    bin: Ints

    def __getitem__(self, which: NDArray[np.bool_]) -> "_Beams":
        return _Beams(*(getattr(self, field.name)[which] for field in fields(self)))


def calibrate(scans: Iterable[Scan]) -> Calibration:
    """From scans (at least 10, rather 100) of a sensor that stands still before walls.

    On a wall, an error of the bearing acts on the range with the lever rho tan(incidence): the variance of residuals
    is sigma_range² + lever² sigma_bearing². Only what changes from scan to scan counts, not the shape of the wall.
    Raises EvaluationError if there are too few scans, no walls, or the sensor moved.
    """
    taken = list(scans)
    if len(taken) < LEAST_SCANS:
        raise EvaluationError(
            f"{len(taken)} scans are too few: give at least {LEAST_SCANS} of a sensor at rest."
        )
    beams = _on_walls(taken)
    off = np.abs(beams.error - _medians(beams.error, beams.bin)[beams.bin])
    kept = off <= _OUTLIER * _MAD * np.maximum(_medians(off, beams.bin), 1e-4)[beams.bin]
    good = beams[kept]
    drift = _drift(good, len(taken))
    if drift > STILL:
        raise EvaluationError(
            f"A wall moved by {1e3 * drift:.0f} mm from the first scans to the last: calibration needs a sensor that "
            "stands still, and walls that do."
        )
    variances, dof, lever2, ranges, incidence = _scatter(good)
    whole = variance_model(variances, dof, lever2, ranges, 1)
    lost, all_ = (np.bincount(beams.scan, x, len(taken)) for x in (~kept, np.ones(len(kept))))
    return Calibration(
        whole.sigmas[0],
        whole.slope,
        variance_model(variances, dof, lever2, ranges, BANDS),
        variance_model(variances, dof, lever2, incidence, BANDS),
        share(np.asarray(lost, np.float64), np.asarray(all_, np.float64)),
        drift,
        len(np.unique(good.wall)),
        len(good.error),
    )


def _scatter(beams: _Beams) -> tuple[Array, Array, Array, Array, Array]:
    """Of each bin with beams enough: variance of the errors, degrees of freedom, means of lever², range, incidence."""
    n = np.bincount(beams.bin).astype(float)
    enough = n >= LEAST_SCANS
    if enough.sum() < LEAST_BINS:
        raise EvaluationError("Too few beams meet walls: give more scans, or a place with longer walls.")
    mean, square, lever2, ranges, incidence = (
        np.bincount(beams.bin, x)[enough] / n[enough]
        for x in (beams.error, beams.error**2, beams.lever**2, beams.ranges, beams.incidence)
    )
    dof = n[enough] - 1
    return (square - mean**2) * n[enough] / dof, dof, lever2, ranges, incidence


def _on_walls(scans: list[Scan]) -> _Beams:
    ranges, bearings = np.concatenate([[scan.ranges, scan.bearings] for scan in scans], axis=1)
    number = np.repeat(np.arange(len(scans)), [len(scan) for scan in scans])
    mean = _median_scan(ranges, bearings, len(ranges) // len(scans))
    segments = extract(mean, ExtractionSettings(noise=SensorNoise(0.01, 0.001))).segments
    margin = _TRIM * 2 * np.pi / len(mean)
    walls = []
    for wall, line in enumerate(segments.lines):
        first, last = (mean.bearings[i] for i in (segments.first_beam[wall], segments.last_beam[wall]))
        turned = (bearings - first - margin) % (2 * np.pi)
        on = (turned < (last - first) % (2 * np.pi) - 2 * margin) & np.isfinite(ranges)
        incidence = np.angle(np.exp(1j * (bearings[on] - line.alpha)))
        rho = line.r / np.cos(incidence)
        floats = np.array([ranges[on] - rho, rho * np.tan(incidence), rho, np.abs(incidence)])
        ints = np.array([number[on], np.full(on.sum(), wall), 1000 * wall + turned[on] // BIN], np.int64)
        walls.append((floats, ints))
    if not sum(floats.size for floats, _ in walls):
        raise EvaluationError("No walls are seen: let the sensor stand still in a room with straight walls.")
    error, lever, rho, incidence = np.concatenate([floats for floats, _ in walls], axis=1)
    scan, wall_number, bins = np.concatenate([ints for _, ints in walls], axis=1)
    return _Beams(
        error,
        lever,
        rho,
        incidence,
        scan,
        wall_number,
        np.unique(bins, return_inverse=True)[1].astype(np.int64),
    )


def _median_scan(ranges: Array, bearings: Array, sectors: int) -> Scan:
    """A scan with hardly any noise: the median range in each sector, NaN where most beams do not return."""
    sector = ((bearings + np.pi) % (2 * np.pi) / (2 * np.pi) * sectors).astype(np.int64) % sectors
    far = np.where(np.isfinite(ranges), ranges, np.inf)
    medians = np.full(sectors, np.nan)
    seen = np.unique(sector)
    medians[seen] = _medians(far, np.searchsorted(seen, sector))
    medians[np.isinf(medians)] = np.nan
    return Scan(medians, 2 * np.pi * (np.arange(sectors) + 0.5) / sectors - np.pi)


def _medians(values: Array, bins: Ints) -> Array:
    """(B,) the median of the values in each bin 0 ... B - 1, none of them empty."""
    order = np.lexsort((values, bins))
    n = np.bincount(bins)
    start = np.cumsum(n) - n
    medians: Array = (values[order][start + (n - 1) // 2] + values[order][start + n // 2]) / 2
    return medians


def _drift(beams: _Beams, scans: int) -> float:
    """By how much (m) the wall that moved most did so, from the first third of the scans to the last."""
    third = scans // 3
    early, late = beams.scan < third, beams.scan >= scans - third
    moved = [
        abs(float(np.median(beams.error[on & late]) - np.median(beams.error[on & early])))
        for on in (beams.wall == wall for wall in np.unique(beams.wall))
        if (on & early).any() and (on & late).any()
    ]
    return max(moved, default=0.0)
