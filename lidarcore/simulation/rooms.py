"""Rooms to simulate in."""

import numpy as np

from lidarcore.scan import Array
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
    boxes = [_box(2.3, 2.5, 0.9, 0.7, 0.3), _box(6.3, 5.3, 1.0, 0.6, 0.45), _box(6.6, 1.7, 0.7, 0.8, 0.0)]
    return World(np.concatenate([_polygon(_OUTLINE), *boxes, np.array([_PANEL])]))


def rectangular_room(length: float, width: float) -> World:
    """Four walls around the origin, m."""
    x, y = length / 2, width / 2
    return World(_polygon(((-x, -y), (x, -y), (x, y), (-x, y))))


def random_pose(world: World, rng: np.random.Generator, clearance: float = 0.4) -> Array:
    """A pose (x m, y m, heading rad) inside the furnished room, at least `clearance` from every wall."""
    while True:
        x, y = rng.uniform(-0.5, 9), rng.uniform(0, 8)
        if _inside(x, y) and world.clearance(x, y) >= clearance:
            return np.array([x, y, rng.uniform(-np.pi, np.pi)])


def _inside(x: float, y: float) -> bool:
    """True if the outline goes around the point and no box does: a ray crosses walls an odd number of times."""
    walls = furnished_room().walls[:-1]
    above = walls[..., 1] > y
    crossing = above[:, 0] != above[:, 1]
    start, end = walls[crossing, 0], walls[crossing, 1]
    at = start[:, 0] + (y - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end[:, 0] - start[:, 0])
    return int((at > x).sum()) % 2 == 1


def _polygon(vertices: tuple[tuple[float, float], ...]) -> Array:
    points = np.array(vertices, np.float64)
    return np.stack([points, np.roll(points, -1, axis=0)], 1)


def _box(x: float, y: float, length: float, width: float, turn: float) -> Array:
    c, s = np.cos(turn), np.sin(turn)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length / 2, width / 2]
    points = half @ np.array([[c, s], [-s, c]]) + [x, y]
    return np.stack([points, np.roll(points, -1, axis=0)], 1)
