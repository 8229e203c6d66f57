"""The patches of several scans as one map of surface elements, with a grid to find them by."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.mapping.cells import cells
from lidarcore.mapping.matching.patches import Patches

_GAP = 0.1  # m between two surfaces side by side
_CELLS = 4_000_000  # of the grid; a map wider than that is cut


class Surfels(NamedTuple):
    """M surface elements in the frame of the map, sorted by the cells of a grid.

    means, normals  (M, 2)
    variances       (M,) m² of a mean along its normal
    tilts           (M,) rad² variance of the normal's direction
    near            (M,) whether returns near each other make it, see Patches.counts
    low             (2,) m corner of the grid
    cell            m
    first           (W, H + 1) index of the first element of each cell; those of a column of cells follow each other
    """

    means: Array
    normals: Array
    variances: Array
    tilts: Array
    near: Bools
    low: Array
    cell: float
    first: Ints


def surfels(seen: Patches, size: float, cell: float) -> Surfels:
    """Elements of `size` m from patches in the frame of the map, to be found within `cell` m."""
    means, normals, weights = seen.means, seen.normals, 1 / seen.variances
    key = cells(means, normals, size, _GAP)
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    number = np.diff(starts, append=len(order))

    def of_cells(values: Array) -> Array:
        return np.add.reduceat(values[order], starts) if len(starts) else values

    total, tilt = of_cells(weights), of_cells(weights * seen.tilts)
    mean, normal = (of_cells(weights[:, None] * v) for v in (means, normals))
    length = np.hypot(*normal.T)
    rows = mean / total[:, None], normal / length[:, None], 1 / total, tilt / total / number
    return _sorted(*rows, of_cells(seen.counts) > 0, cell)


def _sorted(
    means: Array, normals: Array, variances: Array, tilts: Array, near: Bools, cell: float
) -> Surfels:
    low = means.min(axis=0) - cell if len(means) else np.zeros(2)
    at = np.floor((means - low) / cell).astype(np.int64)
    shape = np.minimum(at.max(axis=0, initial=0) + 2, int(np.sqrt(_CELLS)))
    kept = np.flatnonzero((at < shape).all(axis=1))
    flat = at[kept, 0] * (shape[1] + 1) + at[kept, 1]
    order = kept[np.argsort(flat, kind="stable")]
    first = np.zeros((shape[0], shape[1] + 1), np.int64)
    _index(at[order], first)
    return Surfels(
        means[order], normals[order], variances[order], tilts[order], near[order], low, cell, first
    )


@kernel
def _index(at: Ints, first: Ints) -> None:
    """Where the elements (M, 2), sorted, of each cell begin."""
    k = 0
    for i in range(first.shape[0]):
        for j in range(first.shape[1]):
            first[i, j] = k
            while k < len(at) and at[k, 0] == i and at[k, 1] == j:
                k += 1


@kernel
def nearest(map: Surfels, x: float, y: float, nx: float, ny: float, reach: float, side: float) -> int:
    """The element nearest to a place whose normal makes a cosine of at least `side` with (nx, ny); -1 if none."""
    found, closest = -1, reach * reach
    left, right = _cells_between(x - reach - map.low[0], x + reach - map.low[0], map.cell, map.first.shape[0])
    low, high = _cells_between(
        y - reach - map.low[1], y + reach - map.low[1], map.cell, map.first.shape[1] - 1
    )
    if low >= high:
        return -1
    for a in range(left, right):
        for k in range(map.first[a, low], map.first[a, high]):
            square = (map.means[k, 0] - x) ** 2 + (map.means[k, 1] - y) ** 2
            if square < closest and map.normals[k, 0] * nx + map.normals[k, 1] * ny > side:
                found, closest = k, square
    return found


@inlined
def _cells_between(low: float, high: float, cell: float, number: int) -> tuple[int, int]:
    """First cell, and the one after the last, of those along an axis that reach from low to high."""
    return max(int(np.floor(low / cell)), 0), min(int(np.floor(high / cell)) + 1, number)
