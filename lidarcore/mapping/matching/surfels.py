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
    number = cells(seen.means, seen.normals, size, _GAP)
    means, normals, variances, tilts, near = _merged(*seen, number, int(number.max(initial=-1)) + 1)
    low = means.min(axis=0) - cell if len(means) else np.zeros(2)
    at = np.floor((means - low) / cell).astype(np.int64)
    width, height = np.minimum(at.max(axis=0, initial=0) + 2, int(np.sqrt(_CELLS)))
    first = np.zeros((width, height + 1), np.int64)
    order = _sorted(at, first)
    return Surfels(
        means[order], normals[order], variances[order], tilts[order], near[order], low, cell, first
    )


@kernel
def _merged(
    means: Array, normals: Array, variances: Array, tilts: Array, counts: Array, number: Ints, elements: int
) -> tuple[Array, Array, Array, Array, Bools]:
    """The elements that patches with the same number make together: the first five fields of Surfels."""
    mean, normal = np.zeros((elements, 2)), np.zeros((elements, 2))
    weight, tilt, patches = np.zeros(elements), np.zeros(elements), np.zeros(elements)
    near = np.zeros(elements, np.bool_)
    for i in range(len(number)):
        k, w = number[i], 1 / variances[i]
        for axis in range(2):
            mean[k, axis] += w * means[i, axis]
            normal[k, axis] += w * normals[i, axis]
        weight[k] += w
        tilt[k] += w * tilts[i]
        patches[k] += 1
        near[k] |= counts[i] > 0
    for k in range(elements):
        length = np.hypot(normal[k, 0], normal[k, 1])
        for axis in range(2):
            mean[k, axis] /= weight[k]
            normal[k, axis] /= length
        tilt[k] /= weight[k] * patches[k]
    return mean, normal, 1 / weight, tilt, near


@kernel
def _sorted(at: Ints, first: Ints) -> Ints:
    """The elements, which lie in cells (M, 2), by their cells, less those beyond the grid.

    first (W, H + 1), of zeros, becomes that of Surfels.
    """
    inside = 0
    for a, b in at:
        if a < first.shape[0] and b < first.shape[1] - 1:
            first[a, b] += 1
            inside += 1
    end = 0
    for a in range(first.shape[0]):
        for b in range(first.shape[1]):
            end += first[a, b]
            first[a, b] = end
    order = np.empty(inside, np.int64)
    for k in range(len(at) - 1, -1, -1):
        a, b = at[k]
        if a < first.shape[0] and b < first.shape[1] - 1:
            first[a, b] -= 1
            order[first[a, b]] = k
    return order


@inlined
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
