"""Where walls end by themselves: between the last beam that meets a wall and the first that looks past it."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.walls.parts import Part
from lidarcore.mapping.walls.pieces import Pieces

_NEAR = 0.15  # m from the end of a wall, within which segments that end tell of it


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """An end of a wall along its line.

    t         m
    variance  m², by beams and noise; 0 where it was not seen to end
    seen      False if the wall may go on: nobody looked past it
    members   (N,) segments that say so
    gain      (N, 3) how it moves with the poses of their keyframes
    """

    t: float
    variance: float
    seen: bool
    members: Ints
    gain: Array


def find_end(pieces: Pieces, part: Part, side: int) -> End:
    """The lower end (side 0) or the upper one (side 1)."""
    outermost, outward = (part.low, part.high)[side], (-1, 1)[side]
    t, _ = part.fit.coordinates(pieces.ends[part.members, side])
    beyond, _ = part.fit.coordinates(pieces.beyond[part.members, side])
    told = (np.abs(outermost - t) < _NEAR) & (outward * (beyond - t) > 0) & (np.abs(beyond - t) < 2 * _NEAR)
    if not told.any():
        nearest = int(np.argmin(np.abs(t - outermost)))
        return _end(pieces, part, np.array([nearest]), np.array([outermost]), np.array([np.inf]))
    width = np.abs(beyond[told] - t[told])
    return _end(pieces, part, np.flatnonzero(told), (t[told] + beyond[told]) / 2, width)


def _end(pieces: Pieces, part: Part, which: Ints, at: Array, width: Array) -> End:
    """Weighted by what is left open: a uniform law over each width, and the noise along the wall."""
    members, seen = part.members[which], bool(np.isfinite(width).all())
    variance = (width**2 / 12 if seen else 0.0) + pieces.noise_along[members] ** 2
    weight = 1 / variance
    weight /= weight.sum()
    t = float(weight @ at)
    distance = (part.fit.point(t) - pieces.position[members]) @ part.fit.normal
    along = np.broadcast_to(part.fit.along, (len(members), 2))
    gain = weight[:, None] * np.column_stack([along, distance])
    return End(t, float((weight**2 * variance).sum()), seen, members, gain)
