"""Scans whose clock or odometry breaks off: left out until they agree with each other again."""

from dataclasses import dataclass

import numpy as np

from lidarcore.errors import MotionError
from lidarcore.localization.estimate import Instant
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.poses import compose
from lidarcore.scan import Array

_AGREEING = 3  # scans in a row that have to agree before a new clock or odometry is believed
_PERIOD = 0.1  # s, for a gap that the clock cannot tell


@dataclass(frozen=True, slots=True, eq=False)
class Bridge:
    """What is known of the motion across a break: an increment (3,) seen from before it, and its covariance (3, 3)."""

    increment: Array
    covariance: Array


class Continuity:
    """Remembers the scans left out since the last one that the filter took."""

    def __init__(self, settings: LocalizationSettings) -> None:
        self._settings = settings
        self._last: Instant | None = None
        self.restart()

    def restart(self) -> None:
        """Forget what was left out."""
        self._chain: list[Instant] = []
        self._increment = np.zeros(3)

    def accept(self, now: Instant) -> None:
        """The filter took this one."""
        self._last = now
        self.restart()

    def reject(self, now: Instant) -> Bridge | None:
        """The filter refused this one; how to go on from it, once it and those before it agree."""
        if not self._agrees(now):
            self.restart()
        self._chain.append(now)
        if len(self._chain) < _AGREEING:
            return None
        return Bridge(self._increment, self._covariance())

    def _agrees(self, now: Instant) -> bool:
        if self._settings.motion == "odometry" and now.odometry is None:
            return False
        if not self._chain:
            return True
        try:
            _, increment = self._chain[-1].until(now, self._settings)
        except MotionError:
            return False
        if increment is not None:
            self._increment = compose(self._increment, increment)
        return True

    def _covariance(self) -> Array:
        """Of moving at any usual speed for as long as nothing is known."""
        first, settings = self._chain[0], self._settings
        gap = first.stamp - self._last.stamp if self._last is not None else _PERIOD
        unknown = gap if gap > 0 else _PERIOD
        if settings.motion == "constant velocity":
            unknown += self._chain[-1].stamp - first.stamp
        way, turn = settings.velocity.speed * unknown, settings.velocity.turn_rate * unknown
        return np.diag([way, way, turn]) ** 2
