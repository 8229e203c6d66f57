"""How fast the sensor was at a scan, by the steps before and after it."""

import numpy as np

from lidarcore.arrays import Array

_STILL = np.zeros(3)


class Velocity:
    """At the last keyframe and at the last scan, each (3,) m/s, m/s, rad/s.

    began     at the keyframe
    now       at the last scan, by the step to it alone
    between   at the last scan but one: what was `now` tells of half a step earlier, which matters while one speeds up
    """

    def __init__(self) -> None:
        self.began = self.now = self.between = _STILL
        self._is_first, self._leaves = True, True

    def step(self, velocity: Array) -> None:
        """From scan to scan the sensor went as fast as that in the mean."""
        self.between = velocity if self._is_first else (self.now + velocity) / 2
        if self._leaves:
            self.began = self.between
        self.now, self._is_first, self._leaves = velocity, False, False

    def leave(self) -> None:
        """What follows is seen from the last scan."""
        self.began, self._leaves = self.now, True
