"""Scores of a correlative search: a grid that says how well a point fits there, and what a block of shifts adds up."""

import numpy as np

from lidarcore.arrays import Array, Ints, Singles
from lidarcore.compiled import finite_kernel, kernel

SHIFT = 3
BLOCK = 1 << SHIFT  # cells, side of a block of shifts
_REACH = 3  # standard deviations of the blur
_AT_ONCE = 16  # points whose scores are summed until it is looked whether a shift can still win


def score_grid(points: Array, cell: float, blur: float) -> tuple[Array, Singles]:
    """Corner (2,) m of a grid around the points, and its scores: 1 at a point, falling off like a Gaussian.

    The outermost blocks are 0: what lies beyond the grid scores as they do.
    """
    margin = _REACH * blur + (BLOCK + 1) * cell
    low = points.min(axis=0) - margin
    blocks = np.ceil((points.max(axis=0) + margin - low) / cell / BLOCK).astype(np.int64)
    grid = np.zeros(blocks * BLOCK, np.float32)
    _splat((points - low) / cell, blur / cell, grid)
    return low, grid


@finite_kernel
def _splat(points: Array, blur: float, grid: Singles) -> None:
    """Largest of the Gaussians around the points, all in cells."""
    reach = int(np.ceil(_REACH * blur))
    along, across = np.empty(2 * reach + 1), np.empty(2 * reach + 1)
    for k in range(len(points)):
        # The margin leaves nothing below 0: who compiles this is told, so that the loops vectorise.
        i, j = max(int(points[k, 0]) - reach, 0), max(int(points[k, 1]) - reach, 0)
        for n in range(2 * reach + 1):
            along[n] = np.exp(-((i + n + 0.5 - points[k, 0]) ** 2) / (2 * blur * blur))
            across[n] = np.exp(-((j + n + 0.5 - points[k, 1]) ** 2) / (2 * blur * blur))
        for m in range(2 * reach + 1):
            for n in range(2 * reach + 1):
                grid[i + m, j + n] = max(grid[i + m, j + n], along[m] * across[n])


@finite_kernel
def largest_around(fine: Singles) -> Singles:
    """Largest score in each block and its next neighbours: what a point of the block can meet within a block's side."""
    blocks = np.zeros((fine.shape[0] // BLOCK, fine.shape[1] // BLOCK), np.float32)
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            a, b = i // BLOCK, j // BLOCK
            blocks[a, b] = max(blocks[a, b], fine[i, j])
    for a in range(blocks.shape[0]):
        for b in range(blocks.shape[1]):
            for c in range(a, min(a + 2, blocks.shape[0])):
                for d in range(b, min(b + 2, blocks.shape[1])):
                    blocks[a, b] = max(blocks[a, b], blocks[c, d])
    return blocks


@kernel
def sum_scores(
    fine: Singles, blocks: Singles, cells: Ints, u: int, v: int, bound: float, best: float, scores: Singles
) -> float:
    """Writes sums of the scores of points in cells (N, 2), for each shift of the block from (u, v); 0 beyond the grid.

    `bound` is what no shift of the block exceeds, as its surroundings tell; returned is what the scores themselves tell
    of that. Where it is no more than the best shift has, some points are left out of the sums.
    """
    scores[:] = 0.0
    for k in range(len(cells)):
        x, y = cells[k, 0] + u, cells[k, 1] + v
        i, j = max(min(x, fine.shape[0] - BLOCK), 0), max(min(y, fine.shape[1] - BLOCK), 0)
        for a in range(BLOCK):
            for b in range(BLOCK):
                scores[a, b] += fine[i + a, j + b]
        if 0 <= x < fine.shape[0] and 0 <= y < fine.shape[1]:
            bound -= blocks[x >> SHIFT, y >> SHIFT]
        if k % _AT_ONCE == _AT_ONCE - 1 and bound + scores.max() <= best:
            break
    return bound + scores.max()
