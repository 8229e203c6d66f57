"""A scan as patches: short pieces of its surfaces, each with a normal and with how well it is known across."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import act, rotate
from lidarcore.mapping.matching.sight import Sight, sight
from lidarcore.mapping.settings import MatchSettings
from lidarcore.scan import Scan

_LEAST = 3  # points that make a line
_BEAMS = 2.2  # a line reaches at least this many beams' spacing to either side
_WIDE = 0.01  # rad between beams from which on hardly one meets both sides of an edge
_STEP = 0.1  # m by which neighbouring ranges differ at an edge, at least
_GRAZING = 5.0  # cotangent of the angle at which a wall is met, up to which it is no edge
_MEAN, _NORMAL, _VARIANCE, _TILT, _COUNT, _FIELDS = 0, 2, 4, 5, 6, 7  # of a table of patches


class Patches(NamedTuple):
    """N pieces of surface in the order of their bearings, sensor frame.

    means      (N, 2) m
    normals    (N, 2) towards the sensor
    variances  (N,) m² of a mean along its normal: noise, or scatter where that is more, and unevenness
    tilts      (N,) rad² variance of the normal's direction
    counts     (N,) returns that make it
    """

    means: Array
    normals: Array
    variances: Array
    tilts: Array
    counts: Array


def patches(scan: Scan, settings: MatchSettings) -> Patches:
    """The patches of a scan; none where fewer than three neighbouring returns make a line."""
    seen = sight(scan)
    if len(seen.bearings) < _LEAST:
        return Patches(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
    noise = np.array([settings.noise.sigma_range, settings.noise.sigma_bearing]) ** 2
    rows = _rows(seen, settings.radius, settings.gap, settings.patch, noise)
    variances = rows[:, _VARIANCE] + settings.unevenness**2
    means, normals = (rows[:, column : column + 2].copy() for column in (_MEAN, _NORMAL))
    return Patches(means, normals, variances, rows[:, _TILT].copy(), rows[:, _COUNT].copy())


def placed(seen: Patches, pose: Array) -> Patches:
    """Patches of a sensor at a pose (3,), in the frame of the pose."""
    return seen._replace(means=act(pose, seen.means), normals=rotate(pose[2], seen.normals))


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
    single, table = np.empty((len(points), _FIELDS)), np.empty((len(points), _FIELDS))
    _fit_lines(points, ranges, reaches, gap, noise, single)
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
def _fit_lines(points: Array, ranges: Array, reaches: Array, gap: float, noise: Array, single: Array) -> None:
    """Each point as a patch of its own: on the line of its neighbours, which it counts."""
    N = len(points)
    for i in range(N):
        px, py = points[i]
        first, count = _neighbours(points, i, reaches[i] * reaches[i], max(gap, reaches[i]) ** 2)
        x = y = xx = xy = yy = 0.0
        for j in range(count):
            k = first + j if first + j < N else first + j - N
            u, v = points[k, 0] - px, points[k, 1] - py
            x += u
            y += v
            xx += u * u
            xy += u * v
            yy += v * v
        x, y = x / count, y / count
        xx, xy, yy = xx / count - x * x, xy / count - x * y, yy / count - y * y
        half, root = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        direction = np.arctan2(2 * xy, xx - yy) / 2
        nx, ny = -np.sin(direction), np.cos(direction)
        if nx * px + ny * py > 0:
            nx, ny = -nx, -ny
        across = (nx * px + ny * py) / ranges[i]
        variance = noise[0] * across**2 + noise[1] * ranges[i] ** 2 * (1 - across**2)
        variance = max(variance, max(half - root, 0.0) * count / max(count - 2, 1))
        row = single[i]
        row[_MEAN], row[_MEAN + 1], row[_NORMAL], row[_NORMAL + 1] = px, py, nx, ny
        row[_VARIANCE], row[_TILT] = variance, variance / max(count * (half + root), 1e-9)
        row[_COUNT] = count


@kernel
def _neighbours(points: Array, i: int, reach: float, gap: float) -> tuple[int, int]:
    """First point and number of points of the run around point i, by squared distances; around the ring."""
    N = len(points)
    first, count = i, 1
    for way in (-1, 1):
        k, x, y = i, points[i, 0], points[i, 1]
        while count < N:
            k += way
            if k < 0:
                k = N - 1
            elif k == N:
                k = 0
            u, v = points[k, 0], points[k, 1]
            if (u - x) ** 2 + (v - y) ** 2 > gap:
                break
            if (u - points[i, 0]) ** 2 + (v - points[i, 1]) ** 2 > reach:
                break
            x, y = u, v
            count += 1
            if way < 0:
                first = k
    return first, count


@kernel
def _gather(single: Array, size: float, table: Array) -> int:
    """Neighbouring points up to `size` m apart that lie on one line, together; returns the number of rows."""
    number, n = 0, 0
    sx = sy = 0.0
    for i in range(len(single)):
        one = single[i]
        if one[_COUNT] < _LEAST:
            continue
        x, y, nx, ny = one[_MEAN], one[_MEAN + 1], one[_NORMAL], one[_NORMAL + 1]
        if n > 0:
            far = (x - sx) ** 2 + (y - sy) ** 2 > size * size
            bent = table[number, _NORMAL] * nx + table[number, _NORMAL + 1] * ny < 0.9 * n
            if far or bent:
                _close(table[number], n)
                number, n = number + 1, 0
        if n == 0:
            sx, sy = x, y
            table[number] = 0.0
        for column in range(_COUNT):
            table[number, column] += one[column]
        n += 1
    if n > 0:
        _close(table[number], n)
        number += 1
    return number


@kernel
def _close(row: Array, n: int) -> None:
    """Sums into means; the variance of the mean falls with the number of points, that of the tilt does not."""
    norm = np.hypot(row[_NORMAL], row[_NORMAL + 1])
    for axis in range(2):
        row[_MEAN + axis] /= n
        row[_NORMAL + axis] /= norm
    row[_VARIANCE], row[_TILT], row[_COUNT] = row[_VARIANCE] / n / n, row[_TILT] / n, n
