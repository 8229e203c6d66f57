"""Scans whose clock or odometry breaks off: left out until they agree with each other again, or go on without."""

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import compose, relative
from lidarcore.localization.ekf.estimate import Instant
from lidarcore.localization.settings import LocalizationSettings

# scans in a row that have to agree before a new clock or odometry, or that there is none, is believed
_AGREEING = 3
_PERIOD = 0.1  # s, for a gap that the clock cannot tell
_LONGEST = 10.0  # s without knowledge, after which nothing is known
_RECENT = 30  # scans from which the usual period and speed are known
_PAUSE, _PERIODS = 1.0, 5.0  # s, and usual periods: a longer gap may hide more of the way than its ends tell


@dataclass(frozen=True, slots=True, eq=False)
class Bridge:
    """What is known of the motion across a break: an increment (3,) seen from before it, and its covariance (3, 3)."""

    increment: Array
    covariance: Array


class Continuity:
    """Remembers the last scans that the filter took, and those left out since."""

    def __init__(self) -> None:
        self._recent: deque[Instant] = deque(maxlen=_RECENT)
        self._missing = self._stalled = self.left_out = 0  # scans in a row
        self._restart()

    def _restart(self) -> None:
        self._chain: list[Instant] = []
        self._increment = np.zeros(3)

    @property
    def is_broken(self) -> bool:
        """So many scans were left out that the sensor may have gone on meanwhile."""
        return self.left_out >= _AGREEING

    def motion(
        self, now: Instant, used: Literal["odometry", "constant velocity"]
    ) -> Literal["odometry", "constant velocity"]:
        """What can predict the pose at this instant, which is asked once for each scan."""
        self._missing = 0 if now.odometry is not None else self._missing + 1
        if self._missing >= _AGREEING:
            return "constant velocity"
        known = self._recent and self._recent[-1].odometry is not None
        return "odometry" if known and now.odometry is not None else used

    def check(self, now: Instant) -> None:
        """Raise MotionError if the clock stands still: without time nothing can be predicted."""
        stands = bool(self._recent) and now.stamp == self._recent[-1].stamp
        self._stalled = self._stalled + 1 if stands else 0
        if self._stalled >= _AGREEING:
            raise MotionError("The clock stands still: give each scan the time at which it was taken.")

    def accept(self, now: Instant) -> None:
        """The filter took this one."""
        self._recent.append(now)
        self.left_out = 0
        self._restart()

    def reject(self, now: Instant, settings: LocalizationSettings) -> Bridge | None:
        """The filter refused this one; how to go on from it, once it and those before it agree."""
        self.left_out += 1
        if not self._agrees(now, settings):
            self._restart()
        self._chain.append(now)
        if len(self._chain) < _AGREEING:
            return None
        bridge = Bridge(self._increment, self._across_break(settings))
        self._recent.clear()
        return bridge

    def hidden(self, now: Instant, settings: LocalizationSettings) -> Array | None:
        """Covariance (3, 3) of what a long gap hides of the way, beside the noise of odometry from end to end.

        The sensor may have gone on as fast as before on a way of that length back to where it is: a heading that
        drifts evenly along a way W there and back displaces its end with a variance of W²/12 of its own. None if the
        gap is none.
        """
        if settings.motion != "odometry" or not self._recent:
            return None
        try:
            dt, increment = self._recent[-1].until(now, settings)
        except MotionError:
            return None
        stamps = np.array([instant.stamp for instant in self._recent])
        period = float(np.median(np.diff(stamps))) if len(stamps) > 1 else _PERIOD
        if increment is None or dt <= max(_PAUSE, _PERIODS * period):
            return None
        way, turn = np.maximum(dt * self._pace() - [np.hypot(*increment[:2]), np.abs(increment[2])], 0.0)
        covariance = settings.odometry.covariance(np.array([way, 0.0, turn]))
        covariance[:2, :2] += covariance[2, 2] * way**2 / 12 * np.eye(2)
        return covariance

    def drift(self, settings: LocalizationSettings) -> Array:
        """Covariance (3, 3) of moving at any usual speed for one scan."""
        return self._at_any_speed(_PERIOD, settings)

    def _pace(self) -> Array:
        """(2,) m/s and rad/s at which odometry went lately."""
        went = np.zeros(2)
        for before, after in pairwise(self._recent):
            if before.odometry is not None and after.odometry is not None:
                x, y, turn = relative(before.odometry, after.odometry)
                went += [np.hypot(x, y), np.abs(turn)]
        return went / max(self._recent[-1].stamp - self._recent[0].stamp, _PERIOD)

    def _agrees(self, now: Instant, settings: LocalizationSettings) -> bool:
        if settings.motion == "odometry" and now.odometry is None:
            return False
        if not self._chain:
            return True
        try:
            dt, increment = self._chain[-1].until(now, settings)
        except MotionError:
            return False
        if increment is not None:
            self._increment = compose(self._increment, increment)
        return dt > 0

    def _across_break(self, settings: LocalizationSettings) -> Array:
        """Covariance (3, 3) of moving at any usual speed for as long as nothing is known."""
        first = self._chain[0]
        gap = first.stamp - self._recent[-1].stamp if self._recent else _PERIOD
        unknown = _PERIOD if gap <= 0 and self._goes_on(first, settings) else min(abs(gap), _LONGEST)
        if settings.motion == "constant velocity":
            unknown += self._chain[-1].stamp - first.stamp
        return self._at_any_speed(unknown, settings)

    def _goes_on(self, now: Instant, settings: LocalizationSettings) -> bool:
        """Odometry says that only the clock was set back: a recording that is wound back is elsewhere."""
        last = Instant(now.stamp - _AGREEING * _PERIOD, self._recent[-1].odometry)
        try:
            return last.until(now, settings)[1] is not None
        except MotionError:
            return False

    def _at_any_speed(self, duration: float, settings: LocalizationSettings) -> Array:
        way, turn = settings.velocity.speed * duration, settings.velocity.turn_rate * duration
        return np.diag([way, way, turn]) ** 2
