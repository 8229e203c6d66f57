"""Maps of whole scans into the file of maps and out of it: grids, and walls that were seen often enough."""

import zlib
from collections.abc import Sequence

import numpy as np

from lidarcore.errors import MapFileError, UnknownSessionError
from lidarcore.landmarks import StoredGrid, StoredWall
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable

from .session_writer import SessionWriter

CONFIRMED = 3  # scans of the map that saw a wall; what fewer saw may have been somebody who stood there


class WallWriter(SessionWriter):
    """Writes the grid and the confirmed walls of a run."""

    _written: WallTable | None = None

    def write(self, grid: OccupancyGrid, walls: WallTable, *, final: bool) -> None:
        """Write all of them, unless they are those on the disk. Raises LandmarkMapError."""
        confirmed = to_stored(walls)
        if walls is self._written or (self._map is None and not confirmed):
            return
        try:
            self._begun().put_walls(confirmed, grid_to_stored(grid))
        except UnknownSessionError:
            self._map = self._written = None
            raise
        self._written = walls


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
        raise MapFileError(f"The grid of this map is damaged: {error}.") from error
    return OccupancyGrid(table, stored.resolution, np.array([stored.x, stored.y, stored.heading]))
