"""How well a point fits a map, for every cell, and the best of squares of cells: the bounds of a search."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt

from lidarcore.arrays import Array, Ints
from lidarcore.errors import LocalizationError
from lidarcore.mapping.grid import OccupancyGrid

Bytes = NDArray[np.uint8]

FULL = 200
"""Fit of a point in an occupied cell."""
LEVELS = 7
"""Sides of the squares: 1, 2, 4 ... 64 cells."""
OCCUPIED, OPEN = 1, 2
"""States of cells; any other is neither, or not known."""
_MOST_CELLS = 20_000_000
_MARGIN = 1 << (LEVELS - 1)


class Field(NamedTuple):
    """An H x W part of a grid with a margin, ready to be searched for a pose:

    levels  (LEVELS, H, W) best fit of the square of 2^level cells that begins at a cell
    room    (LEVELS, H, W) 1 where such a square holds a cell in which a sensor may be
    states  (H, W) OCCUPIED; OPEN: free and not near anything occupied; 0 anything else
    corner  (2,) column and row in the grid of the first cell
    """

    levels: Bytes
    room: Bytes
    states: Bytes
    corner: Ints


def searchable(grid: OccupancyGrid) -> OccupancyGrid:
    """The grid, or the same in larger cells if its walls lie within too many to be searched at once.

    Raises LocalizationError if nothing in it is occupied.
    """
    rows, columns = np.nonzero(grid.occupied)
    if not len(rows):
        raise LocalizationError("Nothing is occupied in this map: there is nothing to find a place by.")
    height, width = int(np.ptp(rows)) + 1, int(np.ptp(columns)) + 1
    times = 1
    while (height // times + 2 * _MARGIN + 2) * (width // times + 2 * _MARGIN + 2) > _MOST_CELLS:
        times += 1
    return grid.coarser(times) if times > 1 else grid


def make_field(grid: OccupancyGrid, reach: float) -> Field:
    """The field of a grid in which something is occupied."""
    rows, columns = np.nonzero(grid.occupied)
    low = np.array([columns.min(), rows.min()]) - _MARGIN
    shape = np.array([rows.max(), columns.max()]) + 1 + _MARGIN - low[::-1]
    occupied, free = (_part(mask, low, shape) for mask in (grid.occupied, grid.free))
    distance = distance_transform_edt(~occupied) * grid.resolution
    fit = np.rint(FULL * np.exp(-((distance / reach) ** 2) / 2)).astype(np.uint8)
    states = np.where(occupied, OCCUPIED, np.where(free & (distance > 3 * reach), OPEN, 0)).astype(np.uint8)
    room = binary_dilation(free, iterations=1).astype(np.uint8)
    return Field(_pyramid(fit), _pyramid(room), states, low)


def _part(mask: "NDArray[np.bool_]", low: Array, shape: Array) -> "NDArray[np.bool_]":
    part = np.zeros(tuple(shape), bool)
    from_row, from_column = max(int(low[1]), 0), max(int(low[0]), 0)
    inside = mask[from_row : int(low[1] + shape[0]), from_column : int(low[0] + shape[1])]
    row, column = from_row - int(low[1]), from_column - int(low[0])
    part[row : row + inside.shape[0], column : column + inside.shape[1]] = inside
    return part


def _pyramid(base: Bytes) -> Bytes:
    levels = np.zeros((LEVELS, *base.shape), np.uint8)
    levels[0] = base
    for level in range(1, LEVELS):
        before, step = levels[level - 1], 1 << (level - 1)
        wide = before.copy()
        np.maximum(wide[:, :-step], before[:, step:], out=wide[:, :-step])
        levels[level] = wide
        np.maximum(levels[level][:-step], wide[step:], out=levels[level][:-step])
    return levels
