"""An office of 2,000 m²: rooms around a ring of corridors, and a large room with desks and pillars within."""

from collections.abc import Iterable, Sequence

import numpy as np

from lidarcore.arrays import Array
from lidarcore.simulation.rooms import box, polygon
from lidarcore.simulation.world import World

LENGTH, WIDTH = 50.0, 40.0  # m
MIDDLE = 7.3  # m from the outer walls to the middle of the corridors
_DEPTH, _INNER = 6.0, 8.6  # m from the outer walls to both walls of the corridors
_THICK = 0.12  # m
_DOOR, _WIDE_DOOR = 1.0, 1.6  # m
_COLUMNS = LENGTH / 8 * np.arange(9)  # m, between the rooms below and above
_ROWS = np.linspace(_DEPTH, WIDTH - _DEPTH, 5)  # between those on the left and right
_DESKS = (
    (13, 12), (18, 12), (32, 12), (37, 12), (30, 16), (36, 16),
    (32, 24), (37, 24), (31, 28), (37, 28), (13, 25), (18, 28),
)  # fmt: skip
_PILLARS = ((16.8, 16), (33.2, 20), (16.8, 24), (28.5, 24))


def office() -> World:
    """Outer walls around the origin's quadrant, x from 0 to 50 m and y from 0 to 40 m."""
    outline = polygon(((0, 0), (LENGTH, 0), (LENGTH, WIDTH), (0, WIDTH)))
    return World(np.concatenate([outline, *_rooms(), *_large_room()]))


def _rooms() -> Iterable[Array]:
    """Walls between the outer rooms, and towards the corridors; those in the corners open to the room beside them."""
    below = [_DEPTH / 2, *(_COLUMNS[1:-2] + np.diff(_COLUMNS)[1:-1] / 2), LENGTH - _DEPTH / 2]
    for y, to in ((_DEPTH, 0.0), (WIDTH - _DEPTH, WIDTH)):
        yield from _wall((0, y), (LENGTH, y), below, _DOOR)
        for x in _COLUMNS[1:-1]:
            yield from _wall((x, y), (x, to))
    beside = (_ROWS[:-1] + np.diff(_ROWS) / 2 - _DEPTH).tolist()
    for at, to in ((_DEPTH, 0.0), (LENGTH - _DEPTH, LENGTH)):
        yield from _wall((at, _DEPTH), (at, WIDTH - _DEPTH), beside, _DOOR)
        for row in _ROWS[1:-1]:
            yield from _wall((at, row), (to, row))


def _large_room() -> Iterable[Array]:
    """Its walls, each with a door in the middle, desks that stand a little askew, and pillars."""
    low, right, top = _INNER, LENGTH - _INNER, WIDTH - _INNER
    corners = ((low, low), (right, low), (right, top), (low, top))
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        yield from _wall(start, end, [float(np.hypot(*np.subtract(end, start))) / 2], _WIDE_DOOR)
    for k, (x, y) in enumerate(_DESKS):
        yield box(x, y, 1.6, 0.8, 0.15 * (k % 5 - 2))
    for at in _PILLARS:
        yield box(*at, 0.5, 0.5, 0)


def _wall(
    start: Sequence[float], end: Sequence[float], doors: Sequence[float] = (), width: float = 0.0
) -> Iterable[Array]:
    """Pieces of a wall between doors whose middles lie so far (m) from its start."""
    a, along = np.array(start, np.float64), np.subtract(end, start)
    length = float(np.hypot(*along))
    edges = np.array([0.0, *(at + side * width / 2 for at in doors for side in (-1, 1)), length]).reshape(
        -1, 2
    )
    for first, last in edges:
        x, y = a + along / length * (first + last) / 2
        yield box(x, y, last - first, _THICK, float(np.arctan2(along[1], along[0])))
