"""Where maps are kept, by what the pipeline asks of it."""

from collections.abc import Hashable, Mapping
from typing import Protocol

from lidarcore.localization import Landmarks
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable


class MapRun(Protocol):
    """Where the map of one run is kept; every method returns at once."""

    @property
    def session(self) -> int | None:
        """The session of the map; None until it holds a landmark."""

    @property
    def ids(self) -> Mapping[int, int]:
        """Ids of the kept landmarks by those of the navigator."""

    def put(self, landmarks: Landmarks, method: str) -> None:
        """Keep the map as it is now; `method` is what found its landmarks."""


class WallRun(Protocol):
    """Where grid and walls of one run are kept."""

    def put(self, grid: OccupancyGrid, walls: WallTable) -> None:
        """Keep them as they are now; returns at once."""


class MapStore(Protocol):
    """Where maps are kept, each in a session of its own."""

    def begin(self, source: str, *, replay: Hashable) -> MapRun:
        """An empty map, to be built; in place of the last one with that `replay`, unless it is None."""

    def begin_walls(self, source: str, *, replay: Hashable) -> WallRun:
        """An empty map of walls, to be built; in place of the last one with that `replay`, unless it is None."""

    def use(self, session: int | None) -> None:
        """No map is built any more; that of a session is used, if one is given."""

    def settle(self) -> None:
        """What was built until now is kept when this returns."""

    def newest(self) -> int | None:
        """The newest session to localize in."""

    def grid(self, session: int) -> OccupancyGrid | None:
        """The grid of a session, if it has one. Raises LandmarkMapError."""

    def walls(self, session: int) -> WallTable:
        """The walls that a session has, if any. Raises UnknownSessionError."""

    def landmarks(self, session: int) -> Landmarks:
        """The map of a session. Raises UnknownSessionError."""

    def is_built(self, session: int) -> bool:
        """Whether SLAM built that map, in a frame of its own. Raises UnknownSessionError."""
