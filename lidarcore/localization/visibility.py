"""Which landmarks a scan should have shown."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.scan import Scan

_ARM = 0.3  # m, about what must be in view on both sides of a corner
_BEAMS = 4  # at least so many on either side
_NEARER = 0.5  # m, beams that end so much before a landmark hide it
_THROUGH = 0.2  # m, beams that end so much behind it show that it is not there
_COMPLETE = 0.7  # share of the beams that must have returned
_UNSEEN = 0.1  # trust lost by what should be seen and is not: corners in plain view are missed often
_ABSENT = 1.0  # trust lost by what the scan looks through


class Costs(NamedTuple):
    """Trust (L,) that landmarks lose if they are not recognised in a scan.

    unseen  if nothing hides them, but from here they may look like none: a corner of a box has sides to be seen from
    absent  if the scan shows what is behind them
    """

    unseen: Array
    absent: Array


class Visibility:
    """What a scan could see, as a function of points (L, 2) m, sensor frame.

    Nothing is expected behind nearer things, where beams did not return, in gaps and outside the field of view.
    """

    def __init__(self, scan: Scan) -> None:
        bearings = scan.bearings % (2 * np.pi)
        order = np.argsort(bearings, kind="stable")
        bearings, ranges = bearings[order], scan.ranges[order]
        self._increment = float(np.median(np.diff(bearings))) if len(scan) > 1 else 2 * np.pi
        # Once more around on either side, so that no window wraps; one more entry for windows at the end.
        self._bearings = np.concatenate([bearings - 2 * np.pi, bearings, bearings + 2 * np.pi])
        self._ranges = np.append(np.tile(np.where(np.isnan(ranges), np.inf, ranges), 3), np.inf)
        self._returned = np.append(0, np.cumsum(np.isfinite(self._ranges)))

    def __call__(self, points: Array) -> Costs:
        """Costs of not recognising landmarks at the points."""
        distance, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
        half = np.maximum(_ARM / np.maximum(distance, _ARM), _BEAMS * self._increment)
        first = np.searchsorted(self._bearings, bearing - half)
        last = np.maximum(np.searchsorted(self._bearings, bearing + half), first + 1)
        nearest = np.minimum.reduceat(self._ranges, np.stack([first, last], -1).ravel())[::2]
        returned = self._returned[last] - self._returned[first]
        in_view = (returned >= _COMPLETE * 2 * half / self._increment) & (nearest > distance - _NEARER)
        return Costs(_UNSEEN * in_view, _ABSENT * (in_view & (nearest > distance + _THROUGH)))
