"""The tables that segmentation works on: the ring of points, and the pieces that it is cut into."""

from typing import NamedTuple

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined


class Ring(NamedTuple):
    """Points in the order of their bearings, with room for as many again, so that the ring can be unrolled.

    points  (3, 2 N) of each: range m, cosine and sine of its bearing
    beams   (2 N,) number of its beam
    """

    points: Array
    beams: Ints


class Pieces(NamedTuple):
    """Pieces of a ring, each to become a wall: first and last point (P,), both included, and the run that it is of."""

    first: Ints
    last: Ints
    run: Ints


@inlined
def first_pieces(pieces: Pieces, count: int) -> Pieces:
    """The first so many of them."""
    return Pieces(pieces.first[:count], pieces.last[:count], pieces.run[:count])


class Cuts(NamedTuple):
    """Where a ring is cut: at points farther than `threshold` m from a chord, and at gaps of `gap` m."""

    threshold: float
    gap: float
