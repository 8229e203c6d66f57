"""Distances and angles between the walls and corners of one scan, with their standard deviations.

Walls of a scan are fitted to points of their own, so their errors are independent; a corner is where two of them meet.
All that is measured is a function of the lines of the walls, so a wall that both features share does not count twice.
"""

from collections.abc import Callable

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MeasureError
from lidarcore.features import Features
from lidarcore.geometry import left_of, unit_vectors
from lidarcore.mapping.measure import Feature, Measurement, angle_of, distance_of

_Points = Callable[[Array], Array]  # of a feature, by the lines (L, 2) of all walls

_STEP = 1e-6  # rad and m, of numeric derivatives


def distance(features: Features, first: Feature, second: Feature) -> Measurement:
    """As `measure.distance` tells of a map: m. Raises MeasureError if there is no such feature, or both are one."""
    return _measured(features, first, second, distance_of)


def angle(features: Features, first: Feature, second: Feature) -> Measurement:
    """Between the lines of two walls, 0 to pi/2. Raises MeasureError if one of them is a corner or unknown."""
    if first.kind != "wall" or second.kind != "wall":
        raise MeasureError("Only walls have a direction: give two walls to measure an angle.")
    return _measured(features, first, second, angle_of)


def _measured(
    features: Features, first: Feature, second: Feature, f: Callable[[Array, Array], float]
) -> Measurement:
    if first == second:
        raise MeasureError("Both features are the same: give two different ones.")
    lines = np.stack([features.lines.alpha, features.lines.r], 1)
    a, b = (_points_of(features, one) for one in (first, second))

    def value(at: Array) -> float:
        return f(a(at), b(at))

    variance = 0.0
    for wall in {*_walls_of(features, first), *_walls_of(features, second)}:
        J = np.array([_slope(value, lines, wall, k) for k in range(2)])
        variance += float(J @ features.lines.covariance[wall] @ J)
    return Measurement(abs(value(lines)), float(np.sqrt(max(variance, 0.0))))


def _slope(f: Callable[[Array], float], lines: Array, wall: int, k: int) -> float:
    step = np.zeros_like(lines)
    step[wall, k] = _STEP
    return (f(lines + step) - f(lines - step)) / (2 * _STEP)


def _walls_of(features: Features, one: Feature) -> list[int]:
    """The numbers of the walls that a feature is made of. Raises MeasureError."""
    count = len(features.segments if one.kind == "wall" else features.corners)
    if not 0 <= one.index < count:
        raise MeasureError(f"There is no {one.kind}-{one.index}: the scan has {count} of them.")
    return [one.index] if one.kind == "wall" else [int(i) for i in features.corners.segments[one.index]]


def _points_of(features: Features, one: Feature) -> _Points:
    """Both ends of a wall, which stay where they are along it, or the corner itself: (2, 2) or (1, 2) m."""
    walls = _walls_of(features, one)
    if one.kind == "corner":
        return lambda lines: _meeting(lines[walls])
    (wall,) = walls
    ends = np.stack([features.segments.start[wall], features.segments.end[wall]])
    alpha = features.lines.alpha[wall]
    along = ends @ left_of(unit_vectors(alpha))

    def points(lines: Array) -> Array:
        normal = unit_vectors(lines[wall, 0])
        return lines[wall, 1] * normal + along[:, None] * left_of(normal)

    return points


def _meeting(lines: Array) -> Array:
    """Where two lines (2, 2) meet: (1, 2) m."""
    place = np.asarray(np.linalg.solve(unit_vectors(lines[:, 0]), lines[:, 1]), np.float64)
    return place[None]
