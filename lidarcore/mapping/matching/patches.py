"""A scan as patches: short pieces of its surfaces, each with a normal and with how well it is known across."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import act, rotate
from lidarcore.mapping.matching.point_lines import (
    COUNT,
    FIELDS,
    LEAST,
    MEAN,
    NORMAL,
    SLANTED,
    TILT,
    VARIANCE,
    add_scatter,
    add_slanted,
    fit_lines,
)
from lidarcore.mapping.matching.sight import Sight, sight
from lidarcore.mapping.settings import MatchSettings
from lidarcore.scan import Scan

_BEAMS = 2.2  # a line reaches at least this many beams' spacing to either side
_WIDE = 0.01  # rad between beams from which on hardly one meets both sides of an edge
_STEP = 0.1  # m by which neighbouring ranges differ at an edge, at least
_GRAZING = 5.0  # cotangent of the angle at which a wall is met, up to which it is no edge


class Patches(NamedTuple):
    """N pieces of surface in the order of their bearings, sensor frame.

    means      (N, 2) m
    normals    (N, 2) towards the sensor
    variances  (N,) m² of a mean along its normal: noise, or scatter where that is more, and unevenness
    tilts      (N,) rad² variance of the normal's direction
    counts     (N,) returns that make it; 0 where they lie so far apart, along a wall that is seen at a slant, that
               it says how walls lie but nothing of where they are seen
    """

    means: Array
    normals: Array
    variances: Array
    tilts: Array
    counts: Array

    @property
    def near(self) -> "Patches":
        """Those whose returns lie near each other."""
        return Patches(*(column[self.counts > 0] for column in self))

    @property
    def near_count(self) -> int:
        """K, how many these are."""
        return int(np.count_nonzero(self.counts))

    @property
    def near_means(self) -> Array:
        """(K, 2) m of these alone."""
        return self.means[self.counts > 0]


def patches(scan: Scan, settings: MatchSettings) -> Patches:
    """The patches of a scan; none where fewer than three neighbouring returns make a line."""
    seen = sight(scan)
    if len(seen.bearings) < LEAST:
        return Patches(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
    told = settings.noise
    noise = np.array([told.sigma_range, told.sigma_bearing, told.range_growth]) ** 2
    rows = _rows(seen, settings.radius, settings.gap, settings.patch, noise)
    variances = rows[:, VARIANCE] + settings.unevenness**2
    means, normals = (rows[:, column : column + 2].copy() for column in (MEAN, NORMAL))
    return Patches(means, normals, variances, rows[:, TILT].copy(), rows[:, COUNT].copy())


def placed(seen: Patches, pose: Array) -> Patches:
    """Patches of a sensor at a pose (3,), or each at a pose of its own (N, 3), in the frame of the poses."""
    return seen._replace(means=act(pose, seen.means), normals=rotate(pose[..., 2], seen.normals))


def joined(several: Sequence[Patches]) -> Patches:
    """The patches of several, all in one frame."""
    return Patches(*(np.concatenate(columns) for columns in zip(*several, strict=True)))


@kernel
def _rows(seen: Sight, radius: float, gap: float, size: float, noise: Array) -> Array:
    """A table of patches up to `size` m long, from lines through points within `radius` m and a few beams."""
    spacing = np.median(np.diff(seen.bearings))
    inner = _beside_no_step(seen.ranges, spacing)
    ranges, bearings = seen.ranges[inner], seen.bearings[inner]
    points = np.stack((ranges * np.cos(bearings), ranges * np.sin(bearings)), -1)
    reaches = np.clip(_BEAMS * spacing * ranges, radius, 4 * radius)
    single, table = np.empty((len(points), FIELDS)), np.empty((len(points), FIELDS))
    fit_lines(points, ranges, reaches, gap, noise, single)
    add_slanted(points, bearings, spacing, noise, single)
    add_scatter(single)
    return table[: _gather(single, size, table)]


@kernel
def _beside_no_step(ranges: Array, spacing: float) -> NDArray[np.bool_]:
    """Which returns (N,) are to be used: where range jumps, beams may meet both sides and report something in between.

    All of them where beams lie so far apart that few meet both sides, and each is needed to tell where a side ends.
    """
    inner, N = np.ones(len(ranges), np.bool_), len(ranges)
    if spacing > _WIDE:
        return inner
    for i in range(N):
        j = i + 1 if i + 1 < N else 0
        most = max(_STEP, _GRAZING * spacing * min(ranges[i], ranges[j]))
        if abs(ranges[i] - ranges[j]) > most:
            inner[i] = inner[j] = False
    return inner


@kernel
def _gather(single: Array, size: float, table: Array) -> int:
    """Neighbouring points up to `size` m apart that lie on one line, together; returns the number of rows."""
    number, n, is_near = 0, 0, True
    sx = sy = 0.0
    for i in range(len(single)):
        one = single[i]
        if 0 < one[COUNT] < LEAST:
            continue
        x, y, nx, ny = one[MEAN], one[MEAN + 1], one[NORMAL], one[NORMAL + 1]
        if n > 0:
            far = (x - sx) ** 2 + (y - sy) ** 2 > size * size or (one[COUNT] > 0) != is_near
            bent = table[number, NORMAL] * nx + table[number, NORMAL + 1] * ny < 0.9 * n
            if far or bent:
                _close(table[number], n, is_near)
                number, n = number + 1, 0
        if n == 0:
            sx, sy, is_near = x, y, one[COUNT] > 0
            table[number] = 0.0
        for column in range(COUNT):
            table[number, column] += one[column]
        n += 1
    if n > 0:
        _close(table[number], n, is_near)
        number += 1
    return number


@kernel
def _close(row: Array, n: int, is_near: bool) -> None:
    """Sums into means; the variance of the mean falls with the number of points, that of the tilt does not."""
    norm = np.hypot(row[NORMAL], row[NORMAL + 1])
    for axis in range(2):
        row[MEAN + axis] /= n
        row[NORMAL + axis] /= norm
    row[VARIANCE], row[TILT], row[COUNT] = (
        row[VARIANCE] / n / n,
        row[TILT] / n,
        n if is_near else SLANTED,
    )
