"""Places to drive a simulated robot through, listed once in WORLDS: page, command line and tests derive from it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import SimulationError
from lidarcore.simulation.office import LENGTH, MIDDLE, WIDTH, office
from lidarcore.simulation.paths import ROUND, Path, standing, wandering
from lidarcore.simulation.posts import Posts, scattered
from lidarcore.simulation.rooms import box, furnished_room, polygon, rectangular_room
from lidarcore.simulation.routes import Limits, Route, drive, drive_round, drive_there_and_back
from lidarcore.simulation.world import World


@dataclass(frozen=True, eq=False, slots=True)
class Place:
    """A world by its name, and the paths through it, the usual one first."""

    name: str
    title: str
    world: World
    paths: Mapping[str, Path]
    posts: Posts | None = None

    def path(self, name: str | None = None) -> Path:
        """The path of that name; the usual one without. Raises SimulationError if there is none."""
        if name is not None and name not in self.paths:
            raise SimulationError(
                f"{self.title} has no path {name!r}: choose one of {', '.join(self.paths)}."
            )
        return next(iter(self.paths.values())) if name is None else self.paths[name]


def place(name: str) -> Place:
    """The world of that name. Raises SimulationError if there is none."""
    if name not in WORLDS:
        raise SimulationError(f"There is no world {name!r}: choose one of {', '.join(WORLDS)}.")
    return WORLDS[name]


def way(path: Path, step: float = 0.25) -> Array:
    """Points (M, 2) m that a path passes in one round, one every `step` s."""
    duration = path.duration if isinstance(path, Route) else ROUND
    return path(np.arange(0, duration, step))[:, :2]


def hall(posts: Posts, paths: Mapping[str, Path]) -> Place:
    """Posts in a hall so large that its walls are more than 8 m from where x is 0 to 20 m and y within 4 m."""
    walls = rectangular_room(42, 26).walls + np.array([10.0, 0.0])
    return Place("field", "Field of posts", World(walls), paths, posts)


def trajectories() -> dict[str, Route]:
    """Three curves y(x), 20 m long in x, at up to 1 m/s, for the experiment of [EKF]: their shapes are ours."""
    x = np.linspace(0, 20, 2001)
    curves = {
        "straight": 0 * x,
        "lane change": 1.5 * np.tanh((x - 10) / 2),
        "sine": 1.5 * np.sin(np.pi * x / 5),
    }
    return {name: drive(np.column_stack([x, y]), Limits(speed=1.0)) for name, y in curves.items()}


def _furnished() -> Place:
    paths = {"figure of eight": wandering, "standing": standing}
    return Place("furnished room", "Furnished room", furnished_room(), paths)


def _two_rooms() -> Place:
    """Two rooms of 5.9 x 5 m side by side, two doors in the wall between them, a table in each."""
    outline = polygon(
        (
            (0, 0), (5.9, 0), (5.9, 0.7), (6.1, 0.7), (6.1, 0), (12, 0),
            (12, 5), (6.1, 5), (6.1, 4.3), (5.9, 4.3), (5.9, 5), (0, 5),
        )
    )  # fmt: skip
    boxes = [box(6, 2.5, 0.2, 1.4, 0), box(2.9, 2.5, 1.2, 0.7, 0.2), box(9.2, 2.5, 1.0, 0.8, -0.35)]
    loop = drive_round(((3.5, 1.25), (10.8, 1.25), (10.8, 3.75), (1.2, 3.75), (1.2, 1.25)), rounding=2.4)
    return Place(
        "two rooms", "Two rooms with doors", World(np.concatenate([outline, *boxes])), {"loop": loop}
    )


def _corridor() -> Place:
    """A corridor of 20 x 3 m whose doors lie 0.3 m deep in the walls."""
    below = [(x + dx, y) for x in (2.5, 8.0, 14.5) for dx, y in ((0, -1.5), (0, -1.8), (1, -1.8), (1, -1.5))]
    above = [(x + dx, y) for x in (17.0, 10.5, 5.0) for dx, y in ((1, 1.5), (1, 1.8), (0, 1.8), (0, 1.5))]
    outline = polygon(((0, -1.5), *below, (20, -1.5), (20, 1.5), *above, (0, 1.5)))
    paths = {"there and back": drive_there_and_back(((1.2, 0), (18.8, 0)))}
    return Place("corridor", "Corridor", World(outline), paths)


def _field() -> Place:
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    eight = np.column_stack([10 + 8 * np.sin(t), 2.5 * np.sin(2 * t)])
    paths: dict[str, Path] = {
        "loop": drive_round(((5, -2.5), (19, -2.5), (19, 2.5), (1, 2.5), (1, -2.5)), rounding=3.0),
        "figure of eight": drive_round(eight, rounding=1.0),
        **trajectories(),
    }
    driven = np.concatenate([way(path) for path in paths.values()])
    posts = scattered(np.random.default_rng(1), 26, (-2, 22, -5.5, 5.5), driven)
    return hall(posts, paths)


def _office() -> Place:
    """Out of the large room, through three quarters of the corridors, and back."""
    right, top, x, y = LENGTH - MIDDLE, WIDTH - MIDDLE, LENGTH / 2, WIDTH / 2
    round_ = (
        (x - 5, y), (MIDDLE, y), (MIDDLE, MIDDLE), (right, MIDDLE), (right, top), (x, top), (x, y),
    )  # fmt: skip
    return Place("office", "Office of 2,000 m²", office(), {"round": drive_round(round_, rounding=2.4)})


WORLDS: dict[str, Place] = {
    world.name: world for world in (_furnished(), _two_rooms(), _corridor(), _office(), _field())
}
