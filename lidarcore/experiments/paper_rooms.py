"""Rooms as large as those of [CWLF] and [WCTLS], with as many walls and corners in view; theirs are not public."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.evaluation.consistency.places import Place, look, shared_ends
from lidarcore.geometry import left_of
from lidarcore.noise import SensorNoise
from lidarcore.simulation.rooms import box, polygon
from lidarcore.simulation.world import World

BEAMS = 920  # 360 / 0.391, the resolution both papers give
NOISE = SensorNoise(0.05, float(np.radians(0.2)))
"""5 cm are the papers'; of the bearing they give the resolution, 0.391 degrees, half of which is assumed here."""

Recess = tuple[float, float, float]
"""Where on a wall (m from its start), how wide, how deep into the room (negative: a niche)."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A room and where the sensor stands in it: pose x m, y m, heading rad.

    From there `sections` pieces of wall and `corners` corners are in view; chosen (m) is the one the paper picks out.
    """

    name: str
    size: str
    world: World
    pose: tuple[float, float, float]
    sections: int
    corners: int
    chosen: tuple[float, float] | None = None

    def place(self, noise: SensorNoise) -> Place:
        """What is truly seen; the corners follow each other counter-clockwise, sensor frame."""
        return look(self.world, shared_ends(self.world), np.array(self.pose), noise, BEAMS, 0.5)

    def chosen_corner(self) -> int:
        """Index in the place of the corner that the paper picks out."""
        away = self.place(NOISE).corners + self.pose[:2] - np.array(self.chosen)  # the heading is 0
        return int(np.linalg.norm(away, axis=1).argmin())


def _rectangle(length: float, width: float) -> tuple[tuple[float, float], ...]:
    return (0, 0), (length, 0), (length, width), (0, width)


def _outline(vertices: ArrayLike, recesses: Mapping[int, Sequence[Recess]]) -> Array:
    """Walls of a polygon, counter-clockwise, with pillars and niches on its sides by their number, in their order."""
    corners = np.array(vertices, np.float64)
    points = []
    for side, (a, b) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        along = (b - a) / np.linalg.norm(b - a)
        inward = left_of(along)
        points.append(a)
        for at, width, depth in recesses.get(side, ()):
            near, far = a + at * along, a + (at + width) * along
            points += [near, near + depth * inward, far + depth * inward, far]
    return polygon(points)


CWLF_ROOMS = (
    Room(
        "environment A", "9 x 8 m",
        World(np.concatenate([
            _outline(((0, 0), (9, 0), (9, 6), (7.3216, 8), (0, 8)), {
                0: ((1.25, 0.9, -0.6), (2.85, 1.15, -0.55), (4.55, 0.65, 0.45), (5.75, 0.9, -0.6), (7.35, 1.15, -0.55)),
                1: ((1.0, 0.8, 0.5), (2.4, 1.15, -0.5), (4.15, 1.15, 0.45)),
                3: ((0.85, 1.05, 0.5),),
                4: ((1.95, 1.05, -0.5),),
            }),
            box(3.9, 2.65, 0.65, 0.95, 0.9), box(1.7, 5.45, 0.75, 0.8, 0.45), box(6.35, 3.75, 0.75, 0.55, 0.85),
            box(2.3, 2.85, 0.55, 0.5, 1.05), box(2.5, 4.0, 0.9, 0.85, 0.2),
        ])),
        (6.9, 2.45, 0), 36, 23, (7.3216, 8),
    ),
    Room(
        "environment B", "3.5 x 6 m",
        World(np.concatenate([
            _outline(_rectangle(3.5, 6), {
                1: ((3.35, 0.5, 0.5), (4.75, 0.75, -0.5)),
                2: ((0.55, 1.2, -0.5),),
            }),
            box(1.05, 4.85, 0.85, 0.55, 0.5),
        ])),
        (2.5, 5.15, 0), 18, 15, (0, 6),
    ),
)  # fmt: skip

WCTLS_ROOMS = (
    Room(
        "environment A", "4.5 x 2.5 m",
        World(_outline(_rectangle(4.5, 2.5), {
            0: ((0.7, 0.85, -0.6), (2.55, 1.15, 0.55)),
            1: ((0.45, 1.05, 0.55),),
            2: ((1.7, 0.55, 0.6), (2.7, 1.1, -0.55)),
            3: ((0.7, 1.2, -0.5),),
        })),
        (1.2, 1.4, 0), 21, 18,
    ),
    Room(
        "environment B", "18 x 9 m",
        World(np.concatenate([
            _outline(_rectangle(18, 9), {
                0: ((3.3, 2.0, 1.05), (7.05, 0.45, 1.35), (9.5, 1.8, -0.75), (13.15, 1.55, 0.8)),
                2: ((4.05, 2.4, -1.3), (6.9, 1.1, 1.15), (10.95, 1.75, -1.2), (13.5, 0.65, 0.95), (15.3, 0.95, -1.1)),
            }),
            box(4.05, 3.95, 1.6, 1.2, 0.7), box(16.2, 3.95, 1.15, 0.85, 0.9), box(13.7, 6.6, 1.85, 0.75, 0.05),
        ])),
        (8.6, 4.2, 0), 36, 23,
    ),
)  # fmt: skip
