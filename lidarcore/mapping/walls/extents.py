"""From where to where a wall goes: over what was seen of it, unless the grid says that it is free by now."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.grid.occupancy import FREE_UP_TO, OCCUPIED_FROM, Mask, OccupancyGrid
from lidarcore.mapping.walls.fitting import Fit
from lidarcore.mapping.walls.pieces import Pieces
from lidarcore.mapping.walls.settings import WallSettings

_STEP = 0.01  # m between the points at which the grid is asked
# Share of a stretch that must stand: small holes are the grid's, many of them a wall's that is gone.
_SOLID = 0.8
_BAND = 1.0  # cells to both sides within which what stands there is the wall


def stretches(pieces: Pieces, members: Ints, fit: Fit, grid: OccupancyGrid, settings: WallSettings) -> Array:
    """Parts (P, 2) m along the line that were seen and are not free over more than the gap."""
    t, _ = fit.coordinates(pieces.ends[members])
    low, high = t.min(), t.max()
    at = np.arange(low, high + _STEP, _STEP)
    stands, free = _ask(grid, fit, at)
    solid = _covered(at, t) & stands
    there = at[solid]
    if not len(there):
        return np.empty((0, 2))
    through = np.diff(np.cumsum(free)[solid]) * _STEP
    breaks = np.flatnonzero((np.diff(there) > settings.gap) | (through > settings.free_gap))
    first, last = np.append(0, breaks + 1), np.append(breaks, len(there) - 1)
    found = np.stack([there[first], there[last]], -1)
    stands = (last - first + 1) * _STEP >= _SOLID * (found[:, 1] - found[:, 0])
    return found[stands]


def _covered(at: Array, t: Array) -> Mask:
    """True at points (A,) that a segment with ends (N, 2) covers."""
    starts, ends = np.sort(t.min(axis=1)), np.sort(t.max(axis=1))
    begun = np.searchsorted(starts, at + _STEP, "right")
    done = np.searchsorted(ends, at - _STEP, "left")
    return begun > done


def _ask(grid: OccupancyGrid, fit: Fit, at: Array) -> tuple[Mask, Mask]:
    """At points (A,) along a line: whether something may stand within the band, and whether all of it is free.

    Between the beams of one scan nothing is known of a wall's cells: seen on both sides, it stands there, too.
    """
    line = fit.centre + at[:, None] * fit.along
    beside = np.arange(-_BAND, _BAND + 0.25, 0.5) * grid.resolution
    band = line[:, None] + beside[:, None] * fit.normal
    cells = grid.at(band.reshape(-1, 2)).reshape(len(at), -1)
    stands: Mask = np.any((cells >= OCCUPIED_FROM) | (cells < 0), axis=1)
    free: Mask = np.all((cells >= 0) & (cells <= FREE_UP_TO), axis=1)
    return stands, free
