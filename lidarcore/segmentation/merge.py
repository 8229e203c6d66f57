"""Neighbouring pieces: merged where one line explains both."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.noise import NoiseModel
from lidarcore.segmentation.moments import CHI2, SQUARES, copy, join, residuals
from lidarcore.segmentation.pieces import Pieces

# far out for the two or three parameters saved: splits are chosen at extremes, not at random
_MERGE_CHI2 = 25.0


@kernel
def merge(pieces: Pieces, m: Array, count: int, noise: NoiseModel, cost: Array, chain: Ints) -> int:
    """Merge neighbours in one run while one line explains both, cheapest first; the number of pieces left.

    The first `count` pieces and their moments m (count, MOMENTS) are changed in place; cost (count,), chain (2, count)
    and the row m[count] are scratch.
    """
    first, last, run = pieces.first, pieces.last, pieces.run
    joined, before, after = m[count], chain[0], chain[1]
    for i in range(count):
        before[i], after[i] = i - 1, i + 1
        cost[i] = _cost_after(i, after, run, m, count, noise, joined)
    while True:
        i = _cheapest(cost, count)
        if not cost[i] < _MERGE_CHI2:
            break
        gone = after[i]
        cost_of_joining(m[i], m[gone], noise, joined)
        copy(joined, m[i])
        last[i], after[i], cost[gone] = last[gone], after[gone], np.inf
        run[gone] = -1
        if after[i] < count:
            before[after[i]] = i
        cost[i] = _cost_after(i, after, run, m, count, noise, joined)
        k = before[i]
        if k >= 0:
            cost[k] = _cost_after(k, after, run, m, count, noise, joined)
    kept = 0
    for i in range(count):
        if run[i] >= 0:
            first[kept], last[kept], run[kept] = first[i], last[i], run[i]
            copy(m[i], m[kept])
            kept += 1
    return kept


@inlined
def _cost_after(
    i: int, after: Ints, run: Ints, m: Array, count: int, noise: NoiseModel, joined: Array
) -> float:
    """Cost of joining a piece with the one after it; infinite at the end of a run."""
    k = after[i]
    if k == count or run[k] != run[i]:
        return np.inf
    return cost_of_joining(m[i], m[k], noise, joined)


@inlined
def cost_of_joining(a: Array, b: Array, noise: NoiseModel, joined: Array) -> float:
    """Growth of the chi-square of the residuals if one line serves both pieces.

    Taken with each piece's own variance, or all with the variance of the joined one, whichever is less: the first
    errs high on a long wall close by, whose variance differs along it; the second on short pieces, whose best lines
    follow the beams.
    """
    join(a, b, joined)
    together, variance = residuals(joined, noise)
    joined[SQUARES], joined[CHI2] = together, together / variance
    return min(joined[CHI2] - a[CHI2] - b[CHI2], (joined[SQUARES] - a[SQUARES] - b[SQUARES]) / variance)


@inlined
def _cheapest(cost: Array, count: int) -> int:
    best = 0
    for i in range(1, count):
        if cost[i] < cost[best]:
            best = i
    return best


@inlined
def surest_corner(m: Array, count: int, noise: NoiseModel) -> int:
    """The piece that is the most expensive to join with the one before it; m[count] is scratch."""
    surest, most = 1, -np.inf
    for i in range(1, count):
        cost = cost_of_joining(m[i - 1], m[i], noise, m[count])
        if cost > most:
            surest, most = i, cost
    return surest
