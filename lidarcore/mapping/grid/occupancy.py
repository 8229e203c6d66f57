"""An occupancy grid: what stands where, in cells of one size."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Ints
from lidarcore.errors import GridError
from lidarcore.geometry import act, act_inverse

Cells = NDArray[np.int8]
Mask = NDArray[np.bool_]

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
"""Values of cells as ROS has them; those between free and occupied are percentages."""
FREE_UP_TO, OCCUPIED_FROM = 25, 65
"""Per cent, as Nav2 divides them."""
_MOST_CELLS = 100_000_000


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Cells (H, W) of -1 unknown, 0 free to 100 occupied, the first row at the smallest y of the grid's own frame.

    resolution  m, side of a cell
    origin      (3,) m, m, rad: T_world_grid, the outer corner of the first cell of the first row

    Raises GridError if the cells are no table, more than 10^8, or the numbers are not finite.
    """

    cells: Cells
    resolution: float
    origin: Array

    def __post_init__(self) -> None:
        cells, origin = np.asarray(self.cells), np.asarray(self.origin, np.float64)
        if cells.ndim != 2 or not cells.size:
            raise GridError(f"The cells have shape {cells.shape}: give rows and columns (H, W).")
        if cells.size > _MOST_CELLS:
            raise GridError(
                f"The grid has {cells.shape[1]} x {cells.shape[0]} cells, more than {_MOST_CELLS}: use larger cells."
            )
        if not (np.isfinite(self.resolution) and self.resolution > 0):
            raise GridError(f"The resolution is {self.resolution}: give the side of a cell in m.")
        if origin.shape != (3,) or not np.isfinite(origin).all():
            raise GridError(f"The origin is {origin}: give x (m), y (m) and heading (rad), all finite.")
        cells = cells.astype(np.int8)
        cells.flags.writeable = False
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "origin", origin)

    def __repr__(self) -> str:
        height, width = self.cells.shape
        return f"OccupancyGrid({width} x {height} cells of {self.resolution:g} m, {int(self.occupied.sum())} occupied)"

    @cached_property
    def occupied(self) -> Mask:
        """(H, W) true where something stands."""
        return self.cells >= OCCUPIED_FROM

    @cached_property
    def free(self) -> Mask:
        """(H, W) true where nothing stands."""
        return (self.cells >= 0) & (self.cells <= FREE_UP_TO)

    @cached_property
    def extent(self) -> Array | None:
        """(2, 2) m: from and to along x, then along y of the world, of what is known; None if nothing is."""
        known = self.cells != UNKNOWN
        rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        sides = [[ends[0], ends[-1] + 1] for ends in (columns, rows)]
        corners = act(self.origin, self.resolution * np.stack(np.meshgrid(*sides), -1).reshape(-1, 2))
        return np.stack([corners.min(axis=0), corners.max(axis=0)], 1)

    def coarser(self, times: int) -> "OccupancyGrid":
        """The same in cells `times` as large: occupied if something stands in one, else free if one is."""
        short = -np.array(self.cells.shape) % times
        cells = np.pad(self.cells, [(0, short[0]), (0, short[1])], constant_values=UNKNOWN)
        blocks = cells.reshape(cells.shape[0] // times, times, cells.shape[1] // times, times)
        most, least = blocks.max(axis=(1, 3)), np.where(blocks < 0, OCCUPIED, blocks).min(axis=(1, 3))
        merged = np.where((most >= 0) & (most < OCCUPIED_FROM), least, most)
        return OccupancyGrid(merged, self.resolution * times, self.origin)

    def in_cells(self, xy: Array) -> Array:
        """Columns and rows (N, 2), with fractions, of points (N, 2) m in the world, from the grid's first corner."""
        return act_inverse(self.origin, xy) / self.resolution

    def cells_of(self, xy: Array) -> Ints:
        """Row and column (N, 2) of points (N, 2) m in the world, which may lie outside of the grid."""
        return np.floor(self.in_cells(xy)[:, ::-1]).astype(np.int64)

    def at(self, xy: Array) -> Cells:
        """Cells (N,) at points (N, 2) m in the world; what lies outside is unknown."""
        cells = self.cells_of(xy)
        inside = ((cells >= 0) & (cells < self.cells.shape)).all(axis=1)
        values = np.full(len(xy), UNKNOWN, np.int8)
        values[inside] = self.cells[tuple(cells[inside].T)]
        return values

    def centres(self, mask: Mask) -> Array:
        """Centres (N, 2) m in the world of the cells where a mask (H, W) is true."""
        row, column = np.nonzero(mask)
        centres = np.asarray((np.stack([column, row], -1) + 0.5) * self.resolution, np.float64)
        return act(self.origin, centres)
