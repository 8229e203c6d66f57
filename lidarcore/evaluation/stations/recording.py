"""Where in a recording the sensor stood still: its stations."""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from lidarcore.arrays import Array
from lidarcore.recordings import Recording
from lidarcore.scan import Scan

_SECTORS = 180
_AROUND = 10  # scans whose means are compared, before and after
_STILL = 0.03  # m by which the median sector's mean range may differ


def stations(recording: Recording) -> list[list[Scan]]:
    """Stretches of scans, in their order, in which the sensor does not move, as file and ranges say."""
    scans = list(recording)
    starts = [*(recording.stations or (0,)), len(scans)]
    return [still for a, b in pairwise(starts) for still in standstills(scans[a:b])]


def standstills(scans: Iterable[Scan]) -> list[list[Scan]]:
    """Stretches in which most ranges stay what they are.

    Where the sensor stands elsewhere from one scan to the next, they are cut between the two that differ most; scans
    on a longer way belong to none. A move that changes hardly any range, as along a corridor, is not noticed.
    """
    taken = list(scans)
    return [taken[a:b] for a, b in _stretches(np.array([_sector_ranges(scan) for scan in taken])) if b > a]


def _stretches(table: Array) -> Iterator[tuple[int, int]]:
    """Where each stretch without motion begins and ends, from mean ranges (N, _SECTORS) m."""
    moving, steps = _shift(table, _AROUND) > _STILL, _shift(table, 1)
    edges = np.flatnonzero(np.diff(moving, prepend=False, append=False)).reshape(-1, 2)
    begin = 0
    for low, high in edges.tolist():
        if high - low <= 2 * _AROUND:
            low = high = low + int(np.argmax(steps[low:high]))
        yield begin, low
        begin = high
    yield begin, len(table)


def _sector_ranges(scan: Scan) -> Array:
    """(_SECTORS,) m, the mean range in each, NaN where nothing returns."""
    bearings, ranges = scan.bearings[scan.valid], scan.ranges[scan.valid]
    sector = (bearings % (2 * np.pi) / (2 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
    n, total = np.bincount(sector, minlength=_SECTORS), np.bincount(sector, ranges, _SECTORS)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def _shift(table: Array, around: int) -> Array:
    """(N,) m, by how much the median sector's mean over the scans i ... i + around - 1 differs from those before i."""
    filled = np.isfinite(table)
    sums, counts = (
        np.concatenate([np.zeros((1, _SECTORS)), np.cumsum(values, 0)])
        for values in (np.where(filled, table, 0.0), filled)
    )
    at = np.arange(len(table))
    low, high = np.maximum(at - around, 0), np.minimum(at + around, len(table))
    with np.errstate(divide="ignore", invalid="ignore"):
        before = (sums[at] - sums[low]) / (counts[at] - counts[low])
        after = (sums[high] - sums[at]) / (counts[high] - counts[at])
    moved = np.abs(after - before)
    seen = np.isfinite(moved).any(1)
    shift = np.zeros(len(table))
    shift[seen] = np.nanmedian(moved[seen], 1)
    return shift
