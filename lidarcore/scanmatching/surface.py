"""A scan as a surface: each point with the line through its neighbours, so that another scan can be laid on it."""

from typing import NamedTuple

import numpy as np

from lidarcore.compiled import kernel
from lidarcore.scan import Array, Ints, Scan
from lidarcore.scanmatching.settings import MatchSettings


class Surface(NamedTuple):
    """The N returns of a scan in the order of their bearings, sensor frame.

    bearings     (N,) rad in [-pi, pi), growing
    ranges       (N,) m
    points       (N, 2) m
    covariances  (N, 2, 2) m²: the sensor's noise, or more where the points scatter more about their line
    means        (N, 2) m, of the points that make the line of each point
    normals      (N, 2) of these lines, towards the sensor; zero where fewer than three points make the line
    runs         (N, 2) the first of these points and their number, around the ring
    spreads      (N,) m², sum of their squared distances from the mean along the line
    """

    bearings: Array
    ranges: Array
    points: Array
    covariances: Array
    means: Array
    normals: Array
    runs: Ints
    spreads: Array


def surface(scan: Scan, settings: MatchSettings) -> Surface:
    """The surface of a scan."""
    bearings = (scan.bearings[scan.valid] + np.pi) % (2 * np.pi) - np.pi
    order = np.argsort(bearings, kind="stable")
    bearings, ranges = bearings[order], scan.ranges[scan.valid][order]
    points = ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], -1)
    N = len(bearings)
    means, normals, runs = np.zeros((N, 2)), np.zeros((N, 2)), np.zeros((N, 2), np.int64)
    spreads, scatter = np.ones(N), np.zeros(N)
    _fit_lines(points, settings.radius, settings.gap, means, normals, runs, spreads, scatter)
    C = settings.noise.point_covariances(ranges, bearings)
    explained = np.einsum("ni,nij,nj->n", normals, C, normals)
    excess = np.maximum(1.0, scatter / np.where(explained > 0, explained, np.inf))
    return Surface(bearings, ranges, points, C * excess[:, None, None], means, normals, runs, spreads)


@kernel
def _fit_lines(
    points: Array,
    radius: float,
    gap: float,
    means: Array,
    normals: Array,
    runs: Ints,
    spreads: Array,
    scatter: Array,
) -> None:
    """Least-squares line through the neighbours of each point; scatter is the variance of a point about it."""
    N = len(points)
    for i in range(N):
        first, count = _neighbours(points, i, radius, gap)
        x = y = xx = xy = yy = 0.0
        for j in range(count):
            k = (first + j) % N
            u, v = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
            x += u
            y += v
            xx += u * u
            xy += u * v
            yy += v * v
        x, y = x / count, y / count
        xx, xy, yy = xx / count - x * x, xy / count - x * y, yy / count - y * y
        runs[i, 0], runs[i, 1] = first, count
        means[i, 0], means[i, 1] = x + points[i, 0], y + points[i, 1]
        if count < 3:
            continue
        half, root = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        direction = np.arctan2(2 * xy, xx - yy) / 2
        nx, ny = -np.sin(direction), np.cos(direction)
        if nx * means[i, 0] + ny * means[i, 1] > 0:
            nx, ny = -nx, -ny
        normals[i, 0], normals[i, 1] = nx, ny
        spreads[i] = count * (half + root)
        scatter[i] = max(half - root, 0.0) * count / (count - 2)


@kernel
def _neighbours(points: Array, i: int, radius: float, gap: float) -> tuple[int, int]:
    """First point and number of points of the run around point i: no gap in it, no end beyond the radius."""
    N = len(points)
    first, count = i, 1
    for way in (-1, 1):
        k, x, y = i, points[i, 0], points[i, 1]
        while count < N:
            k = (k + way) % N
            u, v = points[k, 0], points[k, 1]
            if np.hypot(u - x, v - y) > gap or np.hypot(u - points[i, 0], v - points[i, 1]) > radius:
                break
            x, y = u, v
            count += 1
            if way < 0:
                first = k
    return first, count
