"""A run of SLAM as it goes into the file: what it gives to be written, and never waits for."""

import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial

from lidarcore.localization import Landmarks
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable

from .map_writer import MapChange, MapWriter
from .wall_writer import WallWriter


@dataclass(frozen=True, slots=True)
class Waiting:
    """What writes the newest map of a run, for the last time or not, and since when something has waited for that."""

    write: Callable[[bool], MapChange | None]
    ended: bool
    since: float


class StoredRun:
    """One run of SLAM as it goes into the file. Every method returns at once.

    `replay` is equal for runs that lead to the same map, as when a recording is repeated; else None.
    """

    def __init__(
        self,
        writer: MapWriter | WallWriter,
        schedule: Callable[["StoredRun", Waiting], None],
        replay: Hashable = None,
    ) -> None:
        self.writer, self.replay, self._schedule = writer, replay, schedule
        self._newest: Callable[[bool], MapChange | None] | None = None

    @property
    def session(self) -> int | None:
        """The session in the file; None until something of the map is on the disk."""
        return self.writer.session

    @property
    def ids(self) -> Mapping[int, int]:
        """Ids in the file of the landmarks on the disk, by those of the navigator."""
        return self.writer.ids

    def end(self) -> None:
        """Write what is left, and that the run has ended."""
        if self._newest:
            self._schedule(self, Waiting(self._newest, ended=True, since=time.monotonic()))

    def _put(self, write: Callable[[bool], MapChange | None]) -> None:
        self._newest = write
        self._schedule(self, Waiting(write, ended=False, since=time.monotonic()))


class LandmarkRun(StoredRun):
    """A map of landmarks."""

    writer: MapWriter

    def put(self, landmarks: Landmarks, method: str = "") -> None:
        """Write the map as it is now, unless a newer one comes first; `method` is what found its landmarks."""
        self._put(partial(self.writer.write, landmarks, method))


class WallRun(StoredRun):
    """A map of walls."""

    writer: WallWriter

    def put(self, grid: OccupancyGrid, walls: WallTable) -> None:
        """Write grid and confirmed walls as they are now, unless newer ones come first."""
        self._put(partial(self.writer.write, grid, walls))
