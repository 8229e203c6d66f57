"""What of a running map of whole scans is on the disk: its grid, and the walls that were seen often enough."""

import time
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from lidarcore.errors import UnknownSessionError
from lidarcore.landmarks import Atlas, LandmarkMap, StoredWall
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable

from .stored_grids import grid_to_stored

CONFIRMED = 3  # keyframes that saw a wall; what fewer saw may have been somebody who stood there


class WallWriter:
    """Writes the grid and the confirmed walls of one run into a session of their own, which begins with the first."""

    ids: Mapping[int, int] = MappingProxyType({})  # of landmarks: it has none

    def __init__(self, atlas: Atlas, source: str, mode: str) -> None:
        self._atlas, self._source, self._mode, self._started = atlas, source, mode, time.time()
        self._map: LandmarkMap | None = None
        self._written: WallTable | None = None

    @property
    def session(self) -> int | None:
        """The id of the session; None before anything is on the disk."""
        return None if self._map is None else self._map.session

    def write(self, grid: OccupancyGrid, walls: WallTable, final: bool) -> None:
        """Bring the disk up to date with the map, at the end of the run as before. Raises LandmarkMapError."""
        confirmed = to_stored(walls)
        if walls is self._written or (self._map is None and not confirmed):
            return
        if self._map is None:
            self._map = self._atlas.begin(self._source, self._started, self._mode)
        try:
            self._map.put_walls(confirmed, grid_to_stored(grid))
        except UnknownSessionError:
            self._map = self._written = None
            raise
        self._written = walls

    def end(self) -> None:
        """Note in the file that the run has ended. Raises LandmarkMapError."""
        if self._map is not None:
            self._atlas.end(self._map.session, time.time())


def to_stored(walls: WallTable) -> list[StoredWall]:
    """The confirmed walls as the file of maps keeps them."""
    C = walls.line_covariance
    columns = [
        walls.ids, walls.alpha, walls.r, C[:, 0, 0], C[:, 0, 1], C[:, 1, 1], *walls.ends.reshape(-1, 4).T,
        walls.length, walls.length_variance, *walls.ended.astype(int).T, *walls.in_corner.astype(int).T,
        walls.first_seen, walls.last_seen, walls.count,
    ]  # fmt: skip
    rows = zip(*(column[walls.count >= CONFIRMED].tolist() for column in columns), strict=True)
    return [StoredWall(*row) for row in rows]


def from_stored(walls: Sequence[StoredWall]) -> WallTable:
    """Walls that the file of maps keeps, as a table."""

    def column(*names: str) -> np.ndarray:
        return np.array([[getattr(wall, name) for name in names] for wall in walls]).reshape(-1, len(names))

    return WallTable(
        column("id")[:, 0].astype(np.int64),
        column("alpha")[:, 0],
        column("r")[:, 0],
        column("var_alpha", "cov_alpha_r", "cov_alpha_r", "var_r").reshape(-1, 2, 2),
        column("x1", "y1", "x2", "y2").reshape(-1, 2, 2),
        column("ended_1", "ended_2").astype(bool),
        column("corner_1", "corner_2").astype(bool),
        column("length")[:, 0],
        column("var_length")[:, 0],
        column("first_seen")[:, 0],
        column("last_seen")[:, 0],
        column("count")[:, 0].astype(np.int64),
    )
