"""How long the front end of a map takes for a scan on this machine, beside a yardstick in the same run."""

import time
from collections.abc import Callable
from functools import partial
from itertools import islice, pairwise

import numpy as np
from scipy.spatial import cKDTree

from lidarcore.arrays import Array
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.precompile import warm_up
from lidarcore.mapping.settings import FrontSettings
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SETTLING = 50  # scans that are not timed: the local map is empty at first
MEDIAN_MS, P99_MS = 2.0, 5.0


def time_front_end(scans: int = 400, seed: int = 0) -> tuple[Array, Array]:
    """Milliseconds (N,) of processor time for each scan of a drive through the office, and for the yardstick's.

    The yardstick finds the nearest point of the scan before for each point of a scan, once, with scipy's k-d tree: one
    of the many steps of a point-to-point registration.
    """
    warm_up()
    seen = list(islice(SimulatedRobot(SimulationSettings(world="office", seed=seed)), SETTLING + scans))
    front = FrontEnd(FrontSettings())
    took = np.array([_milliseconds(partial(front.step, scan)) for scan in seen])
    points = [scan.xy[scan.valid] for scan in seen]
    yardstick = np.array([_milliseconds(partial(_nearest, a, b)) for a, b in pairwise(points)])
    return took[SETTLING:], yardstick[SETTLING - 1 :]


def _nearest(before: Array, xy: Array) -> object:
    return cKDTree(before).query(xy)


def _milliseconds(call: Callable[[], object]) -> float:
    begin = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - begin)
