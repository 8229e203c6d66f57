"""Scores of a correlative search: a grid that says how well a point fits there, and what a block of shifts adds up."""

import numpy as np

from lidarcore.arrays import Array, Ints, Singles, Unsigned
from lidarcore.compiled import finite_kernel, inlined, kernel

SHIFT = 3
BLOCK = 1 << SHIFT  # cells, side of a block of shifts
PAIRS = BLOCK // 2  # of cells, along the same side
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
def largest_ahead(fine: Singles) -> Singles:
    """Largest score that a point of each pair of cells can meet within a block's side: (PAIRS, PAIRS, A, B).

    The first two indices say which pair of its block that is, the others which block: pairs that are whole blocks
    apart are neighbours. Pairs, since one meets 100 cells, and a whole block 256, of which some score well always.
    """
    A, B = fine.shape[0] // BLOCK, fine.shape[1] // BLOCK
    best, ahead = np.zeros((A * PAIRS, B * PAIRS), np.float32), np.empty((PAIRS, PAIRS, A, B), np.float32)
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            best[i >> 1, j >> 1] = max(best[i >> 1, j >> 1], fine[i, j])
    for _ in range(PAIRS):
        for i in range(A * PAIRS - 1):
            for j in range(B * PAIRS):
                best[i, j] = max(best[i, j], best[i + 1, j])
    for i in range(A * PAIRS):
        for _ in range(PAIRS):
            for j in range(B * PAIRS - 1):
                best[i, j] = max(best[i, j], best[i, j + 1])
        for q in range(PAIRS):
            for b in range(B):
                ahead[i % PAIRS, q, i // PAIRS, b] = best[i, b * PAIRS + q]
    return ahead


@kernel
def sum_scores(
    fine: Singles, ahead: Singles, cells: Ints, u: int, v: int, bound: float, best: float, scores: Singles
) -> float:
    """Writes sums of the scores of points in cells (N, 2), for each shift of the block from (u, v); 0 beyond the grid.

    `bound` is what no shift of the block exceeds, as its surroundings tell; returned is what the scores themselves tell
    of that. Where it is no more than the best shift has, some points are left out of the sums.
    """
    scores[:] = 0.0
    flat, sums, at, width = fine.ravel(), scores.ravel(), np.empty(_AT_ONCE, np.uint64), fine.shape[1]
    for first in range(0, len(cells), _AT_ONCE):
        several = cells[first : first + _AT_ONCE]
        for k in range(len(several)):
            x, y = several[k, 0] + u, several[k, 1] + v
            at[k] = max(min(x, fine.shape[0] - BLOCK), 0) * width + max(min(y, width - BLOCK), 0)
            if 0 <= x < fine.shape[0] and 0 <= y < width:
                bound -= ahead[_pair(x), _pair(y), x >> SHIFT, y >> SHIFT]
        for a in range(BLOCK):
            _add_runs(flat, at, len(several), a * width, sums, a * BLOCK)
        if bound + scores.max() <= best:
            break
    return bound + scores.max()


@finite_kernel
def sum_blocks(ahead: Singles, cells: Ints, half: Ints, sums: Singles) -> None:
    """Writes what no shift in a block of shifts exceeds, (A, B) for `half` (2,) blocks of them to either side.

    cells (T, N, 2) are those of the points for each turn, sums (T, A, C) has room for runs of blocks, C >= B.
    """
    _, A, C = sums.shape
    around = np.zeros((PAIRS, PAIRS, ahead.shape[2] + 2 * A, ahead.shape[3] + 2 * C), np.float32)
    around[:, :, A : A + ahead.shape[2], C : C + ahead.shape[3]] = ahead
    flat, at = around.ravel(), np.empty(cells.shape[1], np.uint64)
    height, width = around.shape[2], around.shape[3]
    for t in range(len(cells)):
        n, of_turn = 0, sums[t].ravel()
        for k in range(cells.shape[1]):
            x, y = cells[t, k]
            i, j = (x >> SHIFT) - half[0] + A, (y >> SHIFT) - half[1] + C
            if 0 <= i <= height - A and 0 <= j <= width - C:
                at[n] = ((_pair(x) * PAIRS + _pair(y)) * height + i) * width + j
                n += 1
        of_turn[:] = 0.0
        for a in range(A):
            for c in range(0, C, BLOCK):
                _add_runs(flat, at, n, a * width + c, of_turn, a * C + c)


@inlined
def _pair(cell: int) -> int:
    """Which pair of its block a cell is of, along one side."""
    return (cell & (BLOCK - 1)) >> 1


@inlined
def _add_runs(scores: Singles, at: Unsigned, n: int, offset: int, sums: Singles, first: int) -> None:
    """Adds to a run of sums, from the first on, those runs of scores that begin at n places, so far behind them.

    A run is as long as a block. Its sums are variables of their own, and places have no sign: so they stay in registers
    and are added several at a time, which bounds blocks in a quarter of the time.
    """
    o, ahead = np.uint64(first), np.uint64(offset)
    i1, i2, i3, i4 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
    i5, i6, i7 = np.uint64(5), np.uint64(6), np.uint64(7)
    s0, s1, s2, s3 = sums[o], sums[o + i1], sums[o + i2], sums[o + i3]
    s4, s5, s6, s7 = sums[o + i4], sums[o + i5], sums[o + i6], sums[o + i7]
    for k in range(n):
        i = at[k] + ahead
        s0 += scores[i]
        s1 += scores[i + i1]
        s2 += scores[i + i2]
        s3 += scores[i + i3]
        s4 += scores[i + i4]
        s5 += scores[i + i5]
        s6 += scores[i + i6]
        s7 += scores[i + i7]
    sums[o], sums[o + i1], sums[o + i2], sums[o + i3] = s0, s1, s2, s3
    sums[o + i4], sums[o + i5], sums[o + i6], sums[o + i7] = s4, s5, s6, s7
