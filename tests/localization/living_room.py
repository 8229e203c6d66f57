"""What an RPLIDAR S1 sees in a furnished room while people walk about, and what a Navigator makes of it."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract
from lidarcore.geometry import compose, inverse, wrap
from lidarcore.localization import Landmarks, Navigator, TrackingResult
from lidarcore.scan import Array
from lidarcore.simulation.paths import ROUND, standing, wandering
from lidarcore.simulation.people import Person
from lidarcore.simulation.posts import Posts
from lidarcore.simulation.rooms import furnished_room
from lidarcore.simulation.scene import Optics, Scene

PERIOD, BEAMS = 0.1, 920
NOISE = SensorNoise(0.01, 0.001)
EXTRACTION = ExtractionSettings(noise=NOISE)
PATHS = {"standing": standing, "moving": wandering}
ROOM = furnished_room()


def room_corners() -> Array:
    """(C, 2) m, world frame: where two walls of the room meet."""
    points, walls = np.unique(ROOM.walls.reshape(-1, 2).round(9), axis=0, return_counts=True)
    return points[walls == 2]


def living_room(
    path: str,
    count: int,
    seed: int = 0,
    people: int = 2,
    begin: float = 0.0,
    posts: Posts | None = None,
) -> Iterator[Scan]:
    """Scans with their true poses; beams turn clockwise while the sensor moves, and have times of their own."""
    rng, where = np.random.default_rng(seed), PATHS[path]
    way = where(np.linspace(0, 2 * ROUND, 100))[:, :2]
    scene = Scene(ROOM, where, [Person(ROOM, rng, way) for _ in range(people)], posts)
    optics, since = Optics(NOISE), PERIOD * np.arange(BEAMS) / BEAMS
    for k in range(count):
        times = begin + PERIOD * k + since
        bearings = -2 * np.pi * (np.arange(BEAMS) + rng.uniform()) / BEAMS
        aimed = bearings + rng.normal(0, NOISE.sigma_bearing, BEAMS)
        ranges, quality = optics.observe(*scene.cast(times, aimed), rng)
        yield Scan(ranges, bearings, float(times[0]), quality, since, truth=where(times[:1])[0])


def with_odometry(scans: Iterator[Scan], start: Array) -> Iterator[Scan]:
    """The same with exact wheels, whose own frame begins at a start of its own."""
    first: Array | None = None
    for scan in scans:
        assert scan.truth is not None
        first = scan.truth if first is None else first
        yield replace(scan, odometry=compose(start, compose(inverse(first), scan.truth)))


def navigate(
    navigator: Navigator, scans: Iterator[Scan], change: Callable[[int, Scan], Scan] = lambda _, scan: scan
) -> Iterator[tuple[Scan, TrackingResult]]:
    """Step through the scans, changed if need be."""
    for k, scan in enumerate(scans):
        changed = navigator.deskewed(change(k, scan))
        yield changed, navigator.step(changed, extract(changed, EXTRACTION))


def pose_error(where: TrackingResult, truth: Array) -> Array:
    """(3,) m, m, rad, of the estimate."""
    error = where.estimate.pose - truth
    return np.array([error[0], error[1], wrap(error[2])])


def nearest_corners(landmarks: Landmarks, T_room_world: Array) -> tuple[Array, Array]:
    """Of each confirmed landmark the index of the nearest corner of the room, and how far it is from it (L, 2) m."""
    corners, points = room_corners(), landmarks.points.subset(landmarks.confirmed)
    c, s = np.cos(T_room_world[2]), np.sin(T_room_world[2])
    placed = points.xy @ np.array([[c, s], [-s, c]]) + T_room_world[:2]
    nearest = np.linalg.norm(placed[:, None] - corners, axis=-1).argmin(axis=1)
    return nearest, placed - corners[nearest]
