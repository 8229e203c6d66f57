"""Distances and angles between the walls and corners of one scan, with their standard deviations.

Walls of a scan are fitted to points of their own, so their errors are independent; a corner is where two of them meet.
All that is measured is a function of the lines of the walls, so a wall that both features share does not count twice.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import block_diag

from lidarcore.arrays import Array
from lidarcore.errors import MeasureError
from lidarcore.features import Features
from lidarcore.geometry import left_of, unit_vectors
from lidarcore.mapping.measure import (
    Feature,
    Measurement,
    PointsFunction,
    angle_of,
    check,
    distance_of,
    propagated,
)


def distance(features: Features, first: Feature, second: Feature) -> Measurement:
    """As `measure.distance` tells of a map: m. Raises MeasureError if there is no such feature, or both are one."""
    return _measured(features, first, second, distance_of)


def angle(features: Features, first: Feature, second: Feature) -> Measurement:
    """Between the lines of two walls, 0 to pi/2. Raises MeasureError if one of them is a corner or unknown."""
    return _measured(features, first, second, angle_of)


def _measured(features: Features, first: Feature, second: Feature, f: PointsFunction) -> Measurement:
    check(f, first, second)
    lines = np.stack([features.lines.alpha, features.lines.r], 1)
    a, b = (_points_of(features, one) for one in (first, second))
    walls = sorted({*_walls_of(features, first), *_walls_of(features, second)})

    def value(at: Array) -> float:
        moved = lines.copy()
        moved[walls] = at
        return f(a(moved), b(moved))

    return propagated(value, lines[walls], block_diag(*features.lines.covariance[walls]))


def _walls_of(features: Features, one: Feature) -> list[int]:
    """The numbers of the walls that a feature is made of. Raises MeasureError."""
    count = len(features.segments if one.kind == "wall" else features.corners)
    if not 0 <= one.index < count:
        raise MeasureError(f"There is no {one.kind}-{one.index}: the scan has {count} of them.")
    return [one.index] if one.kind == "wall" else [int(i) for i in features.corners.segments[one.index]]


def _points_of(features: Features, one: Feature) -> Callable[[Array], Array]:
    """Both ends of a wall, which stay where they are along it, or the corner itself, by the lines (L, 2) of all walls.

    (2, 2) or (1, 2) m.
    """
    walls = _walls_of(features, one)
    if one.kind == "corner":
        return lambda lines: _meeting(lines[walls])
    (wall,) = walls
    ends = np.stack([features.segments.start[wall], features.segments.end[wall]])
    along = ends @ left_of(unit_vectors(features.lines.alpha[wall]))

    def points(lines: Array) -> Array:
        normal = unit_vectors(lines[wall, 0])
        return lines[wall, 1] * normal + along[:, None] * left_of(normal)

    return points


def _meeting(lines: Array) -> Array:
    """Where two lines (2, 2) meet: (1, 2) m."""
    return np.asarray(np.linalg.solve(unit_vectors(lines[:, 0]), lines[:, 1]), np.float64)[None]
