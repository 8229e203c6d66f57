"""When samples were measured, from when their bytes arrived."""

import numpy as np

from lidarcore.arrays import Array, Ints

LEAK = 0.01
"""How much slower the sensor's clock may run than it says: 9,200 samples/s are told, 9,259 follow from 108 us."""
WINDOW = 0.3
"""s; of any so long, some bytes come without delay: an adapter's 16 ms and a capsule's 4.32 ms coincide every 0.22 s.

A count that has fallen behind, because nobody could tell that something was lost, is wrong for twice as long."""

_CALM = float("inf")


class SampleClock:
    """Samples are measured evenly; their bytes arrive with delays that vary, but are never early.

    So the lower envelope of arrival minus sample count is the clock, free of the jitter of USB and scheduler. The rest
    is a constant, as in Slamtec's SDK: 1.5 sample periods for measuring, and the time of a packet on the line.
    """

    def __init__(self, period: float, packet_time: float) -> None:
        self.period = period
        self._delay = 1.5 * period + packet_time
        self.reset()

    def reset(self) -> None:
        """Forget earlier samples: the next are not known to be evenly spaced with them."""
        self._before = self._now = self._zero = _CALM  # lowest of the last window, of this one, of both
        self._began, self._newest = -_CALM, 0

    def arrived(self, count: int, arrival: float) -> None:
        """Tell that the first `count` samples had arrived at this time (s)."""
        slack = LEAK * self.period * max(count - self._newest, 0)
        if arrival - self._began > WINDOW:
            self._before, self._now, self._began = self._now, _CALM, arrival
        self._before += slack
        self._now = min(arrival - count * self.period, self._now + slack)
        self._zero, self._newest = min(self._before, self._now), count

    def late(self, count: int, arrival: float) -> float:
        """How much later (s) than expected the first `count` samples have arrived."""
        return arrival - count * self.period - self._zero

    def times(self, indices: Ints) -> Array:
        """When (s) the samples of these indices, counted from 0, were measured."""
        return self._zero - self._delay + self.period * (indices + 1).astype(np.float64)
