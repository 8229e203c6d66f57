"""Beams that meet the walls around a sensor at rest, and how far from the walls' lines they end."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.errors import EvaluationError
from lidarcore.extraction import extract
from lidarcore.lines import Line
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings

BIN = np.radians(1.0)  # in which a wall may be off its line by any amount, if it is so in every scan
_SIGMA_MEDIAN = 0.003  # m, of the medians of all scans
_TRIM = 2  # beams left out at both ends of a wall, where they may be mixed
_OUTLIER = 6.0  # robust sigmas
_MAD = 1.4826  # standard deviation of a Gaussian over its median absolute deviation
_LEAST_SPREAD = 1e-4  # m


@dataclass(frozen=True, slots=True, eq=False)
class WallBeams(Columns):
    """Beams (N,) on walls, the walls' lines as they are at the bearings reported.

    error m, of the range; lever m, rho tan(incidence), by which an error of the bearing acts; ranges m; incidence
    rad, of either sign, from the normal of the wall; alpha rad, direction of that normal; scan, wall, bin: numbers.
    """

    error: Array
    lever: Array
    ranges: Array
    incidence: Array
    alpha: Array
    scan: Ints
    wall: Ints
    bin: Ints

    def near(self) -> NDArray[np.bool_]:
        """(N,) whether a beam ends where noise lets it, judged by the other scans' beams in its bin."""
        off = np.abs(self.error - medians(self.error, self.bin)[self.bin])
        spread = _MAD * np.maximum(medians(off, self.bin), _LEAST_SPREAD)
        near: NDArray[np.bool_] = off <= _OUTLIER * spread[self.bin]
        return near


def beams_on_walls(scans: list[Scan], unevenness: float = 0.0) -> WallBeams:
    """Beams of all scans on walls, sorted in bins along the walls and by bearing in each.

    unevenness m: walls are told apart by it, if it is given. Raises EvaluationError if no walls are seen.
    """
    ranges, bearings = np.concatenate([[scan.ranges, scan.bearings] for scan in scans], axis=1)
    number = np.repeat(np.arange(len(scans)), [len(scan) for scan in scans])
    floats, ints = [], []
    for wall, (line, on) in enumerate(_walls(ranges, bearings, len(scans), unevenness)):
        on = on[np.argsort(((bearings[on] - line.alpha + np.pi) % (2 * np.pi)), kind="stable")]
        incidence = np.angle(np.exp(1j * (bearings[on] - line.alpha)))
        rho = line.r / np.cos(incidence)
        at = (incidence + np.pi) // BIN
        floats.append(
            [ranges[on] - rho, rho * np.tan(incidence), rho, incidence, np.full(len(on), line.alpha)]
        )
        ints.append(np.array([number[on], np.full(len(on), wall), 1000 * wall + at], np.int64))
    if not sum(len(column[0]) for column in ints):
        raise EvaluationError("No walls are seen: let the sensor stand still in a room with straight walls.")
    error, lever, rho, incidence, alpha = np.concatenate(floats, axis=1)
    scan, walls, bins = np.concatenate(ints, axis=1)
    numbered = np.unique(bins, return_inverse=True)[1].astype(np.int64)
    return WallBeams(error, lever, rho, incidence, alpha, scan, walls, numbered)


def _walls(ranges: Array, bearings: Array, scans: int, unevenness: float) -> Iterator[tuple[Line, Ints]]:
    """Each wall's line, and which beams of all scans meet it, but for its ends."""
    mean = _median_scan(ranges, bearings, len(ranges) // scans)
    noise = SensorNoise(_SIGMA_MEDIAN if unevenness else 0.01, 0.001, unevenness=unevenness)
    segments = extract(mean, ExtractionSettings(noise=noise)).segments
    margin = _TRIM * 2 * np.pi / len(mean)
    for wall, line in enumerate(segments.lines):
        first, last = (mean.bearings[i] for i in (segments.first_beam[wall], segments.last_beam[wall]))
        turned = (bearings - first - margin) % (2 * np.pi)
        on = (turned < (last - first) % (2 * np.pi) - 2 * margin) & np.isfinite(ranges)
        yield line, np.flatnonzero(on)


def _median_scan(ranges: Array, bearings: Array, sectors: int) -> Scan:
    """A scan with hardly any noise: the median range in each sector, NaN where most beams do not return."""
    sector = ((bearings + np.pi) % (2 * np.pi) / (2 * np.pi) * sectors).astype(np.int64) % sectors
    far = np.where(np.isfinite(ranges), ranges, np.inf)
    typical = np.full(sectors, np.nan)
    seen = np.unique(sector)
    typical[seen] = medians(far, np.searchsorted(seen, sector))
    typical[np.isinf(typical)] = np.nan
    return Scan(typical, 2 * np.pi * (np.arange(sectors) + 0.5) / sectors - np.pi)


def medians(values: Array, bins: Ints) -> Array:
    """(B,) the median of the values in each bin 0 ... B - 1, none of them empty."""
    order = np.lexsort((values, bins))
    n = np.bincount(bins)
    start = np.cumsum(n) - n
    medians: Array = (values[order][start + (n - 1) // 2] + values[order][start + n // 2]) / 2
    return medians
