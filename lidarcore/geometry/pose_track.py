"""Poses over time."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry.se2 import wrap


class PoseTrack:
    """Poses over time, interpolated linearly, headings along the shorter turn.

    Takes stamps (M,) s in any order and poses (M, 3) in one frame; entries that are not finite are left out.
    """

    def __init__(self, stamps: Array, poses: Array) -> None:
        kept = np.flatnonzero(np.isfinite(stamps) & np.isfinite(poses).all(axis=1))
        kept = kept[np.argsort(stamps[kept], kind="stable")]
        self._stamps, self._poses = stamps[kept], poses[kept]

    def __len__(self) -> int:
        return len(self._stamps)

    def at(self, stamp: float) -> Array | None:
        """Pose (3,) at the stamp in s, or None before the first or after the last pose."""
        if not len(self) or not self._stamps[0] <= stamp <= self._stamps[-1]:
            return None
        last = int(np.searchsorted(self._stamps, stamp, "right")) - 1
        before, since = self._poses[last], stamp - self._stamps[last]
        if since == 0:
            step = np.zeros(3)
        else:
            step = self._poses[last + 1] - before
            step[2] = wrap(step[2])
            step *= since / (self._stamps[last + 1] - self._stamps[last])
        x, y, heading = before + step
        return np.array([x, y, wrap(heading)])
