"""How long a map takes on this machine, scan by scan and as a whole, beside a yardstick in the same run."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import islice, pairwise

import numpy as np
from scipy.spatial import cKDTree

from lidarcore.arrays import Array
from lidarcore.mapping.mapper import Mapper
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.precompile import warm_up
from lidarcore.mapping.settings import FrontSettings, MapperSettings
from lidarcore.scan import Scan
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SETTLING = 50  # scans that are not timed: the local map is empty at first
MEDIAN_MS, P99_MS = 2.0, 5.0


@dataclass(frozen=True, slots=True)
class MapTime:
    """A whole map of a log: what it was made of, and s of processor time.

    steps      until all scans were placed and loops closed
    finish     until all keyframes were adjusted
    yardstick  nearest points of each scan and the one before
    """

    scans: int
    keyframes: int
    loops: int
    steps: float
    finish: float
    yardstick: float


def time_front_end(scans: int = 400, seed: int = 0) -> tuple[Array, Array]:
    """Milliseconds (N,) of processor time for each scan of a drive through the office, and for the yardstick's.

    The yardstick finds the nearest point of the scan before for each point of a scan, once, with scipy's k-d tree: one
    of the many steps of a point-to-point registration.
    """
    warm_up()
    seen = _drive(SETTLING + scans, 1, seed)
    front = FrontEnd(FrontSettings())
    took = np.array([_milliseconds(partial(front.step, scan)) for scan in seen])
    return took[SETTLING:], _yardstick(seen)[SETTLING - 1 :]


def time_map(scans: int, seed: int = 0) -> MapTime:
    """A map of so many scans of a drive through the office, half a second apart, as robots' logs are thinned."""
    warm_up()
    seen, mapper = _drive(scans, 5, seed), Mapper(MapperSettings())
    steps = sum(_milliseconds(partial(mapper.step, scan)) for scan in seen) / 1e3
    finish = _milliseconds(mapper.finish) / 1e3
    yardstick = float(_yardstick(seen).sum()) / 1e3
    return MapTime(scans, len(mapper.keyframes.poses), len(mapper.loops), steps, finish, yardstick)


def _drive(scans: int, every: int, seed: int) -> list[Scan]:
    robot = SimulatedRobot(SimulationSettings(world="office", seed=seed))
    return list(islice(robot, 0, scans * every, every))


def _yardstick(seen: list[Scan]) -> Array:
    """Milliseconds (N - 1,) of processor time for each pair of scans."""
    points = [scan.xy[scan.valid] for scan in seen]
    return np.array([_milliseconds(partial(_nearest, a, b)) for a, b in pairwise(points)])


def _nearest(before: Array, xy: Array) -> object:
    return cKDTree(before).query(xy)


def _milliseconds(call: Callable[[], object]) -> float:
    begin = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - begin)
