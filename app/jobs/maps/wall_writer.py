"""Maps of whole scans into the file of maps and out of it: grids, and walls that were seen often enough."""

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarcore.errors import MapFileError, UnknownSessionError
from lidarcore.files import reason
from lidarcore.landmarks import StoredGrid, StoredWall
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import JointWalls, WallTable, pack_covariance

from .session_writer import SessionWriter

Bools = NDArray[np.bool_]

CONFIRMED = 3  # scans of the map that saw a wall; what fewer saw may have been somebody who stood there


class WallWriter(SessionWriter):
    """Writes the grid and the confirmed walls of a run."""

    _written: WallTable | None = None
    _is_final = False  # of what was written

    def write(self, grid: OccupancyGrid, walls: WallTable, *, final: bool) -> None:
        """Write all of them, unless they are those on the disk; finally how they err together, too.

        Raises LandmarkMapError.
        """
        confirmed = to_stored(walls)
        is_there = walls is self._written and (self._is_final or not final)
        if is_there or (self._map is None and not confirmed):
            return
        try:
            self._begun().put_walls(
                confirmed, grid_to_stored(grid), covariance_to_stored(walls) if final else None
            )
        except UnknownSessionError:
            self._map = self._written = None
            raise
        self._written, self._is_final = walls, final


def are_confirmed(walls: WallTable) -> Bools:
    """Which walls (W,) are kept."""
    confirmed: Bools = walls.count >= CONFIRMED
    return confirmed


def to_stored(walls: WallTable) -> list[StoredWall]:
    """The confirmed walls as the file of maps keeps them."""
    C = walls.line_covariance
    columns = [
        walls.ids, walls.alpha, walls.r, C[:, 0, 0], C[:, 0, 1], C[:, 1, 1], *walls.ends.reshape(-1, 4).T,
        walls.length, walls.length_variance, *walls.ended.astype(int).T, *walls.in_corner.astype(int).T,
        walls.first_seen, walls.last_seen, walls.count,
    ]  # fmt: skip
    rows = zip(*(column[are_confirmed(walls)].tolist() for column in columns), strict=True)
    return [StoredWall(*row) for row in rows]


def covariance_to_stored(walls: WallTable) -> bytes | None:
    """How the confirmed walls err together; None if nobody knows, or they are more than MOST_WALLS."""
    return pack_covariance(walls, are_confirmed(walls)) if isinstance(walls, JointWalls) else None


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


def grid_to_stored(grid: OccupancyGrid) -> StoredGrid:
    """A grid as the file of maps keeps it."""
    (x, y, heading), (rows, columns) = grid.origin.tolist(), grid.cells.shape
    cells = zlib.compress(grid.cells.tobytes())
    return StoredGrid(grid.resolution, x, y, heading, rows, columns, cells)


def grid_from_stored(stored: StoredGrid) -> OccupancyGrid:
    """A grid that the file of maps keeps. Raises MapFileError if it is damaged."""
    count = stored.rows * stored.columns
    try:
        cells = zlib.decompressobj().decompress(stored.cells, count + 1)
        table = np.frombuffer(cells, np.int8).reshape(stored.rows, stored.columns)
    except (zlib.error, ValueError) as error:
        raise MapFileError(f"The grid of this map is damaged: {reason(error)}.") from error
    return OccupancyGrid(table, stored.resolution, np.array([stored.x, stored.y, stored.heading]))
