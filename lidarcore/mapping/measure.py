"""Distances and angles between walls and corners of a map, with their standard deviations.

What two of them have in common, such as the drift of the keyframes that saw both, does not count twice.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array, vstack

from lidarcore.arrays import Array
from lidarcore.errors import MeasureError
from lidarcore.mapping.walls import JointWalls

Kind = Literal["wall", "corner"]
PointsFunction = Callable[[Array, Array], float]
"""Of the points (1, 2) of a corner or (2, 2) of a wall, twice."""

_STEP = 1e-6  # m and rad, of numeric derivatives


@dataclass(frozen=True, slots=True)
class Feature:
    """A wall of a map by its id; a corner, or what a scan shows, by its place."""

    kind: Kind
    index: int


@dataclass(frozen=True, slots=True)
class Measurement:
    """A distance (m) or an angle (rad) and its standard deviation."""

    value: float
    sigma: float


def feature(name: str) -> Feature:
    """The feature of a name such as wall-3 or corner-12, as the files of a map have them. Raises MeasureError."""
    kind, _, number = name.partition("-")
    if kind == "wall" and number.isdecimal():
        return Feature("wall", int(number))
    if kind == "corner" and number.isdecimal():
        return Feature("corner", int(number))
    raise MeasureError(f"{name!r} does not name a feature: give wall-N or corner-N.")


def distance(walls: JointWalls, first: Feature, second: Feature) -> Measurement:
    """Between corners: straight. From a corner to a wall: across its line. Between walls: across, on the average.

    The distance of two walls is that of the middle of each from the line of the other, the mean of both: for
    parallel walls the clear width. Raises MeasureError if there is no such feature.
    """
    return _measured(walls, first, second, distance_of)


def angle(walls: JointWalls, first: Feature, second: Feature) -> Measurement:
    """Between the lines of two walls, from 0 to pi/2. Raises MeasureError if one of them is a corner or unknown."""
    return _measured(walls, first, second, angle_of)


def length(walls: JointWalls, id: int) -> Measurement:
    """Length of a wall, from end to end; a lower bound where it may go on. Raises MeasureError."""
    index = _place(walls, Feature("wall", id))
    return Measurement(float(walls.length[index]), float(np.sqrt(walls.length_variance[index])))


def check(f: PointsFunction, first: Feature, second: Feature) -> None:
    """Raise MeasureError if two features have no such distance or angle."""
    if f is angle_of and "corner" in (first.kind, second.kind):
        raise MeasureError("Only walls have a direction: give two walls to measure an angle.")
    if first == second:
        raise MeasureError("Both features are the same: give two different ones.")


def propagated(f: Callable[[Array], float], at: Array, covariance: Array) -> Measurement:
    """The size of f at numbers (...) whose covariance (N, N) is given, to first order, by numeric derivatives."""
    steps = _STEP * np.eye(at.size).reshape(-1, *at.shape)
    J = np.array([f(at + step) - f(at - step) for step in steps]) / (2 * _STEP)
    return Measurement(abs(f(at)), float(np.sqrt(max(float(J @ covariance @ J), 0.0))))


def _measured(walls: JointWalls, first: Feature, second: Feature, f: PointsFunction) -> Measurement:
    check(f, first, second)
    a, b = (_points(walls, one) for one in (first, second))
    rows = csr_array(vstack([_rows(walls, one) for one in (first, second)]))
    return propagated(
        lambda points: f(points[: len(a)], points[len(a) :]),
        np.concatenate([a, b]),
        walls.model.covariance(rows),
    )


def _place(walls: JointWalls, one: Feature) -> int:
    """Where among the walls or the corners it is. Raises MeasureError."""
    known = walls.ids if one.kind == "wall" else np.arange(len(walls.corners))
    found = np.flatnonzero(known == one.index)
    if not len(found):
        raise MeasureError(
            f"There is no {one.kind}-{one.index}: the map has {len(known)} {one.kind}s, named in its files."
        )
    return int(found[0])


def _points(walls: JointWalls, one: Feature) -> Array:
    """Both ends of a wall, or the corner itself: (2, 2) or (1, 2) m. Raises MeasureError."""
    at = _place(walls, one)
    return walls.ends[at] if one.kind == "wall" else walls.corners.xy[at][None]


def _rows(walls: JointWalls, one: Feature) -> csr_array:
    at = _place(walls, one)
    return walls.model.ends_of(at) if one.kind == "wall" else walls.corners.rows_of(at)


def _across(point: Array, wall: Array) -> float:
    """Signed distance (m) of a point from the line through both ends of a wall."""
    (dx, dy), (px, py) = wall[1] - wall[0], point - wall[0]
    return float((dx * py - dy * px) / np.hypot(dx, dy))


def distance_of(a: Array, b: Array) -> float:
    """Distance (m) of corners (1, 2) or walls (2, 2), with a sign where a corner is on one side of a wall."""
    if len(a) == len(b) == 1:
        return float(np.hypot(*(a[0] - b[0])))
    if len(a) == 1 or len(b) == 1:
        point, wall = (a[0], b) if len(a) == 1 else (b[0], a)
        return _across(point, wall)
    there, back = _across(a.mean(axis=0), b), _across(b.mean(axis=0), a)
    return (abs(there) + abs(back)) / 2


def angle_of(a: Array, b: Array) -> float:
    """Between two walls (2, 2), from 0 to pi/2."""
    (ax, ay), (bx, by) = a[1] - a[0], b[1] - b[0]
    turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return float(np.pi / 2 - abs(abs(turn) - np.pi / 2))
