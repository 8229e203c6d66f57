"""Whether a live map stays as it was while a robot drives on for an hour: size, memory, time of a scan, error."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import islice

import numpy as np
import psutil

from lidarcore.arrays import Array
from lidarcore.geometry import compose, pose_difference
from lidarcore.mapping import WholeScans
from lidarcore.mapping.grid import shades_of
from lidarcore.mapping.precompile import warm_up
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation.robot import RATE, SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

_FREE = 254  # shade of a cell
_SLEEP = 0.001  # s, while keyframes wait: here scans come faster than a sensor sends them
_CATCH_UP = 2.5  # s without scans, within which grid and walls know of the last ones


@dataclass(frozen=True, slots=True)
class Stretch:
    """Some minutes of a drive.

    minute        at its end
    median, p99   s, of what a scan takes until its pose is known
    memory        bytes of this process at its end, the simulation included
    keyframes     that the map has
    free, walls   m² of free cells, and m of walls
    off           m, the largest distance of a tracked pose from the truth
    tracked       share of the scans
    """

    minute: float
    median: float
    p99: float
    memory: int
    keyframes: int
    free: float
    walls: float
    off: float
    tracked: float


def endurance(
    settings: SimulationSettings, minutes: float, stretches: int, done: Callable[[], None] = lambda: None
) -> Iterator[Stretch]:
    """Map a simulated drive of so many minutes as the page does, and tell of each of so many stretches of it."""
    warm_up()
    robot = iter(SimulatedRobot(settings))
    scans = int(minutes * 60 * RATE / stretches)
    first: Array | None = None
    with closing(WholeScans(ExtractionSettings(noise=settings.noise))) as tracker:
        for stretch in range(stretches):
            seen = []
            for scan in islice(robot, scans):
                if first is None:
                    first = scan.truth
                seen.append(_step(tracker, scan, first))
            time.sleep(_CATCH_UP)
            yield _stretch(tracker, seen, minutes * (stretch + 1) / stretches)
            done()


def _step(tracker: WholeScans, scan: Scan, first: Array | None) -> tuple[float, float]:
    """Seconds that the scan took, and how far (m) its pose is from the truth, NaN if it is not tracked."""
    while tracker.is_behind:
        time.sleep(_SLEEP)
    begin = time.perf_counter()
    found = tracker.step(tracker.deskewed(scan))
    took = time.perf_counter() - begin
    if found.state != "tracking" or scan.truth is None or first is None:
        return took, np.nan
    return took, float(np.hypot(*pose_difference(compose(first, found.estimate.pose), scan.truth)[:2]))


def _stretch(tracker: WholeScans, seen: list[tuple[float, float]], minute: float) -> Stretch:
    took, off = np.array(seen).T
    picture = tracker.picture
    grid, walls = (None, None) if picture is None else (picture.grid, picture.walls)
    return Stretch(
        minute,
        float(np.median(took)),
        float(np.quantile(took, 0.99)),
        psutil.Process().memory_info().rss,
        len(tracker.path()) - 1,
        0.0 if grid is None else float((shades_of(grid) == _FREE).sum()) * grid.resolution**2,
        0.0 if walls is None else float(walls.length.sum()),
        float(np.nanmax(off, initial=0.0)),
        float(np.isfinite(off).mean()),
    )
