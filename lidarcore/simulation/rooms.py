"""Rooms to simulate in."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.geometry import act
from lidarcore.simulation.world import World

# A 9 x 8 m room of 36 wall pieces, 23 of them its outline with 23 corners, as environment A of [CWLF] has them.
_OUTLINE = (
    (0, 0), (3.2, 0), (3.2, 0.5), (3.8, 0.5), (3.8, 0), (9, 0), (9, 2.6), (8.5, 2.6), (8.5, 3.2), (9, 3.2), (9, 6.7),
    (7.8, 8), (5.4, 8), (5.4, 7.4), (4.6, 7.4), (4.6, 8), (1.1, 8), (1.1, 6.9), (0, 6.9), (0, 4.4), (-0.5, 4.4),
    (-0.5, 3.4), (0, 3.4),
)  # fmt: skip
_PANEL = ((2.4, 5.6), (3.9, 6.1))


def furnished_room() -> World:
    """The 9 x 8 m room: outline with pillars, niche and a slanted wall, three boxes, one free panel."""
    boxes = [box(2.3, 2.5, 0.9, 0.7, 0.3), box(6.3, 5.3, 1.0, 0.6, 0.45), box(6.6, 1.7, 0.7, 0.8, 0.0)]
    return World(np.concatenate([polygon(_OUTLINE), *boxes, np.array([_PANEL])]))


def rectangular_room(length: float, width: float) -> World:
    """Four walls around the origin, m."""
    x, y = length / 2, width / 2
    return World(polygon(((-x, -y), (x, -y), (x, y), (-x, y))))


def random_pose(world: World, rng: np.random.Generator, clearance: float = 0.4) -> Array:
    """A pose (x m, y m, heading rad) inside a room, at least `clearance` from every wall."""
    low, high = world.walls.min(axis=(0, 1)), world.walls.max(axis=(0, 1))
    while True:
        x, y = rng.uniform(low, high)
        if _inside(world, x, y) and world.clearance(x, y) >= clearance:
            return np.array([x, y, rng.uniform(-np.pi, np.pi)])


def _inside(world: World, x: float, y: float) -> bool:
    """True if walls, counter-clockwise, go around the point just once: twice is inside a box, a panel is no turn."""
    to_wall = world.walls - [x, y]
    (ax, ay), (bx, by) = to_wall[:, 0].T, to_wall[:, 1].T
    turns = np.arctan2(ax * by - ay * bx, ax * bx + ay * by).sum() / (2 * np.pi)
    return bool(round(turns) == 1)


def polygon(vertices: ArrayLike) -> Array:
    """Walls (W, 2, 2) m from corner to corner and back to the first; counter-clockwise, so that the inside is known."""
    points = np.array(vertices, np.float64)
    return np.stack([points, np.roll(points, -1, axis=0)], 1)


def box(x: float, y: float, length: float, width: float, turn: float) -> Array:
    """Walls (4, 2, 2) m of a box around (x, y), turned by `turn` rad."""
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length / 2, width / 2]
    return polygon(act(np.array([x, y, turn]), half))
