"""What all lines of one laser together say, gathered line by line: only stamps and poses are kept of each."""

from array import array

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import relative, wrap

SICK_RANGE = 80.0
"""m that a SICK LMS reaches; 81.83 to 81.91 are its error codes."""

_PER_METRE = 1000  # bins of the histogram of ranges
_RIGID = 1e-3  # m, rad: a mounting that varies by more is none


class Survey:
    """What the readings of a laser say of it.

    beams       numbers of beams in readings without bearings
    largest     the largest range below SICK_RANGE in m, and `ties`, how often it occurs
    """

    def __init__(self) -> None:
        self.beams: set[int] = set()
        self.largest, self.ties = 0.0, 0
        self.mounting = Mounting()
        self._histogram = np.zeros(int(SICK_RANGE) * _PER_METRE, np.int64)
        self._stamps, self._kinds = array("d"), 1
        self._poses = array("d")

    def add(
        self, ranges: Array, stamps: tuple[float, ...], pose: Array | None = None, *, has_bearings: bool
    ) -> None:
        """Take up a reading: ranges (N,) m, what its stamp may be, and the pose (3,) m, m, rad if there is any."""
        if not has_bearings:
            self.beams.add(len(ranges))
        self._stamps.extend(stamps)
        self._kinds = len(stamps)
        if pose is not None:
            self._poses.extend(pose)
        below = ranges[(ranges >= 0) & (ranges < SICK_RANGE)]
        np.add.at(self._histogram, (below * _PER_METRE).astype(np.int64), 1)
        largest = float(below.max(initial=0))
        if largest > self.largest:
            self.largest, self.ties = largest, 0
        self.ties += int(np.sum(below == self.largest))

    def last_metre(self) -> int:
        """How many ranges are less than 1 m below the largest, to a bin."""
        return int(self._histogram[max(int((self.largest - 1) * _PER_METRE), 0) :].sum())

    def stamps(self) -> Array:
        """Candidates (N, kinds) s."""
        return np.frombuffer(self._stamps).reshape(-1, self._kinds)

    def poses(self) -> Array:
        """(M, 3) m, m, rad of the readings that have one."""
        return np.frombuffer(self._poses).reshape(-1, 3)


class Mounting:
    """Where the sensor sits on the robot, by the poses of both: T_base_sensor (3,) of the first, and how all spread."""

    def __init__(self) -> None:
        self.first: Array | None = None
        self._low, self._high = np.zeros(3), np.zeros(3)

    def add(self, base_pose: Array, pose: Array) -> None:
        """Take up T_odom_base and T_odom_sensor."""
        found = relative(base_pose, pose)
        if self.first is None:
            self.first = found
        apart = found - self.first
        apart[2] = wrap(apart[2])
        self._low, self._high = np.fmin(self._low, apart), np.fmax(self._high, apart)

    def is_rigid(self) -> bool:
        """True if all readings say the same."""
        return self.first is not None and bool((self._high - self._low).max() < _RIGID)
