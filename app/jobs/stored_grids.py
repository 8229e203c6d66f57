"""Occupancy grids into the file of maps and out of it."""

import zlib

import numpy as np

from lidarcore.errors import MapFileError
from lidarcore.landmarks import StoredGrid
from lidarcore.mapping.grid import OccupancyGrid


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
