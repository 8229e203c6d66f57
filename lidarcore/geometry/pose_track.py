"""Poses over time."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry.se2 import wrap


class PoseTrack:
    """Poses over time, interpolated linearly, headings along the shorter turn.

    Takes stamps (M,) s in any order and poses (M, 3) in one frame; entries that are not finite are left out.
    """

    def __init__(self, stamps: Array, poses: Array) -> None:
        table = np.column_stack([stamps, poses])
        table = table[np.isfinite(table).all(axis=1)]
        table = table[np.argsort(table[:, 0], kind="stable")]
        self._stamps, self._x, self._y = table[:, 0], table[:, 1], table[:, 2]
        self._heading = np.unwrap(table[:, 3])

    def __len__(self) -> int:
        return len(self._stamps)

    def at(self, stamp: float) -> Array | None:
        """Pose (3,) at the stamp in s, or None before the first or after the last pose."""
        if not len(self) or not self._stamps[0] <= stamp <= self._stamps[-1]:
            return None
        x, y, heading = (
            np.interp(stamp, self._stamps, values) for values in (self._x, self._y, self._heading)
        )
        return np.array([x, y, wrap(heading)])
