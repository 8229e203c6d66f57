"""From a ring of beams to pieces, one for each wall: iterative end point fit, merged back and tidied.

Points are packed (missing returns left out) and the ring is unrolled from a break, so that every piece is a slice.
Pieces are inclusive ranges of points.
"""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.noise import NoiseModel
from lidarcore.segmentation.ends import place_ends
from lidarcore.segmentation.merge import merge, surest_corner
from lidarcore.segmentation.moments import MOMENTS, judge, moments_of
from lidarcore.segmentation.pieces import Cuts, Pieces, Ring, first_pieces
from lidarcore.segmentation.ring import compact, find_breaks, mean_increment, noise_seen, unroll
from lidarcore.segmentation.split import split_runs

__all__ = ["Cuts", "Pieces", "Ring", "compact", "find_pieces", "for_pieces", "mean_increment", "noise_seen"]


@inlined
def for_pieces(noise: NoiseModel, seen: float) -> NoiseModel:
    """The noise that pieces are made for: the noise seen (m), if that is larger.

    Told too little noise, walls would fall apart. Who gives the unevenness of walls has measured both.
    """
    v_rho = noise.v_rho if noise.v_wall > 0 else max(noise.v_rho, seen * seen)
    return NoiseModel(v_rho, *noise[1:])  # v_rho is the first; numba knows no _replace


@kernel
def find_pieces(
    ring: Ring, n: int, noise: NoiseModel, cuts: Cuts, increment: float, scratch: Array, indices: Ints
) -> Pieces:
    """The pieces of a ring of n points, in its order.

    The ring is unrolled, so that it starts at a break and the result does not depend on where the scan starts.
    increment is the mean angle between beams, rad; scratch (2 n,) and indices (6, 2 n) are scratch that the result is
    a part of.
    """
    starts, stack, pieces = indices[0], indices[4], Pieces(indices[1], indices[2], indices[3])
    points, first, last = ring.points, pieces.first, pieces.last
    if n == 0:
        return first_pieces(pieces, 0)
    n_runs = find_breaks(points, n, cuts.gap, increment, noise.v_rho + noise.v_wall, scratch, starts)
    closed = n_runs == 0
    if closed:  # start where the ring surely bends
        starts[0], n_runs = np.argmax(points[0, :n]), 1
    while True:
        starts[n_runs] = starts[0] + n
        unroll(points, ring.beams, n, starts[0])
        count = split_runs(points, starts[: n_runs + 1], cuts.threshold, noise, scratch, stack, pieces)
        m = np.empty((count + 1, MOMENTS))
        moments_of(points, first, last, m, count, trimmed=False)
        for p in range(count):
            judge(m[p], noise)
        count = merge(pieces, m, count, noise, scratch, indices[4:])
        place_ends(points, pieces, m, count, increment, noise)
        if not closed or count < 2:
            return first_pieces(pieces, count)
        moments_of(points, first, last, m, count, trimmed=False)
        for p in range(count):
            judge(m[p], noise)
        # Noise moves the farthest point along its wall: once more from where two walls surely meet.
        starts[0], closed = first[surest_corner(m, count, noise)] % n, False
