"""Each point of a scan on the line of its neighbours, or, on a wall seen at a slant, of the two beams beside it."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined, kernel

LEAST = 3  # points that make a line
MEAN, NORMAL, VARIANCE, TILT, COUNT, SCATTER, FIELDS = 0, 2, 4, 5, 6, 7, 8
"""Columns of a table of patches, and their number; SCATTER is m² by which the points of a line lie off it, summed."""
SLANTED = 0.0
"""Instead of a count: the returns lie far apart, along a wall that is seen at a slant."""
_FARTHEST = 3.0  # m between two of them
_STRAIGHT = 9.0  # squared standard deviations by which the middle one of three is off their line, at most
_RELIEF = 0.01  # m by which walls are off lines of that length
_ROUGH = 5.0  # standard deviations of chi-square by which points of a rough surface scatter more than noise makes them


class _Sums(NamedTuple):
    """Of several points as one of them sees them: their number, coordinates, squares and products in m and m²."""

    number: int
    x: float
    y: float
    xx: float
    xy: float
    yy: float


@kernel
def fit_lines(points: Array, ranges: Array, reaches: Array, gap: float, noise: Array, single: Array) -> None:
    """Each point as a patch of its own: on the line of its neighbours, which it counts.

    noise (3,): variances of a range nearby, m², and of a bearing, and by how much the first grows with rho⁴, 1/m².
    """
    for i in range(len(points)):
        near = _around(points, i, reaches[i] * reaches[i], max(gap, reaches[i]) ** 2)
        _fit_line(points[i], near, noise, single[i])


@inlined
def _fit_line(point: Array, sums: _Sums, noise: Array, row: Array) -> None:
    """A point (2,) on the line of several."""
    (px, py), (count, x, y, xx, xy, yy) = point, sums
    x, y = x / count, y / count
    xx, xy, yy = xx / count - x * x, xy / count - x * y, yy / count - y * y
    half, root = (xx + yy) / 2, np.sqrt(((xx - yy) / 2) ** 2 + xy * xy)
    nx, ny = _normal((xx - yy) / 2, xy, root)
    if nx * px + ny * py > 0:
        nx, ny = -nx, -ny
    square = px * px + py * py
    across = (nx * px + ny * py) ** 2
    row[MEAN], row[MEAN + 1], row[NORMAL], row[NORMAL + 1] = px, py, nx, ny
    row[VARIANCE] = _range_variance(noise, square) * across / square + noise[1] * (square - across)
    row[TILT] = row[VARIANCE] / max(count * (half + root), 1e-9)
    row[COUNT], row[SCATTER] = count, max(half - root, 0.0) * count


@inlined
def _range_variance(noise: Array, square: float) -> float:
    """Variance (m²) of a range, by its square."""
    return noise[0] + noise[2] * square * square


@inlined
def _normal(a: float, b: float, root: float) -> tuple[float, float]:
    """Unit vector (-sin t, cos t) of half the angle 2 t of (a, b), which is `root` long; (0, 1) if that is 0.

    From the larger one of the two, which loses no digits; without the angle itself, which takes longer.
    """
    if root == 0:
        return 0.0, 1.0
    if a > 0:
        c = np.sqrt((root + a) / (2 * root))
        return -b / (2 * root * c), c
    s = np.sqrt((root - a) / (2 * root))
    return -s, b / (2 * root * s)


@kernel
def add_slanted(points: Array, bearings: Array, spacing: float, noise: Array, single: Array) -> None:
    """Points on walls seen at such a slant that the next beams end far away: on the line of three, if they are on one.

    They are what tells the heading in a corridor.
    """
    for i in range(1, len(points) - 1):
        if single[i, COUNT] >= LEAST or bearings[i + 1] - bearings[i - 1] > 3 * spacing:
            continue
        ux, uy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        vx, vy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        if max(np.hypot(ux, uy), np.hypot(vx, vy)) > _FARTHEST:
            continue
        length = np.hypot(ux + vx, uy + vy)
        off = (ux * vy - uy * vx) / length
        across = ((ux + vx) * points[i, 1] - (uy + vy) * points[i, 0]) / length
        square = points[i, 0] ** 2 + points[i, 1] ** 2
        if off * off < _STRAIGHT * (_range_variance(noise, square) * across * across / square + _RELIEF**2):
            _fit_line(points[i], _sum_of(-ux, -uy, vx, vy), noise, single[i])
            single[i, COUNT] = SLANTED


@kernel
def add_scatter(single: Array) -> None:
    """Enlarges the variances of lines whose points scatter more than noise makes them.

    By noise alone, the scatter of few points is half as large as expected here and 1.5 times there: it counts only
    where it is significantly more than noise makes it, or than it is for most lines of the scan if that is less.
    """
    usual = min(_usual_scatter(single), 1.0)
    for row in single:
        free = _free(row)
        if row[SCATTER] > usual * row[VARIANCE] * (free + _ROUGH * np.sqrt(2.0 * free)):
            times = max(row[SCATTER] / (free * row[VARIANCE]), 1.0)
            row[VARIANCE] *= times
            row[TILT] *= times


@kernel
def _usual_scatter(single: Array) -> float:
    """How many times as far as noise makes them, squared, points lie off most lines; 1 if there is no line."""
    times, number = np.empty(len(single)), 0
    for row in single:
        if row[COUNT] >= LEAST:
            free = _free(row)
            median = free * (1.0 - 2.0 / (9.0 * free)) ** 3  # of chi-square, by Wilson and Hilferty
            times[number] = row[SCATTER] / (row[VARIANCE] * median)
            number += 1
    return float(np.median(times[:number])) if number else 1.0


@kernel
def _free(row: Array) -> float:
    """Points of a line beside the two that it goes through; one where they are fewer."""
    return max(max(row[COUNT], LEAST) - 2.0, 1.0)


@inlined
def _sum_of(ux: float, uy: float, vx: float, vy: float) -> _Sums:
    """Of a point and two others, seen from it."""
    return _Sums(3, ux + vx, uy + vy, ux * ux + vx * vx, ux * uy + vx * vy, uy * uy + vy * vy)


@inlined
def _around(points: Array, i: int, reach: float, gap: float) -> _Sums:
    """Of the run of points around point i, by squared distances; around the ring."""
    N, (px, py) = len(points), points[i]
    count, x, y, xx, xy, yy = 1, 0.0, 0.0, 0.0, 0.0, 0.0
    for way in (-1, 1):
        k, before_u, before_v = i, 0.0, 0.0
        while count < N:
            k += way
            if k < 0:
                k = N - 1
            elif k == N:
                k = 0
            u, v = points[k, 0] - px, points[k, 1] - py
            if (u - before_u) ** 2 + (v - before_v) ** 2 > gap or u * u + v * v > reach:
                break
            before_u, before_v = u, v
            count += 1
            x += u
            y += v
            xx += u * u
            xy += u * v
            yy += v * v
    return _Sums(count, x, y, xx, xy, yy)
