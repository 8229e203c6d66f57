"""Odometry that another program sends, and what it says about the moment of a scan."""

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lidarcore import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import PoseTrack, compose, relative
from lidarcore.localization import LocalizationSettings

KEPT = 500  # poses, of the newest
AHEAD = 0.3  # s that a scan may be newer than the newest pose
MOST_PER_SECOND = 1000.0  # poses that are taken; robots send a tenth of it
LEAST = 0.02  # s over which a speed is judged at least: stamps jitter


@dataclass(frozen=True, slots=True)
class OdometryStatus:
    """Odometry sent from outside: poses taken and refused since the last reset, and the newest stamp taken, s.

    `dropped` were more than are taken in a second.
    `used` tells whether the newest scan was given some; if not, `problem` says why, unless none was sent.
    """

    taken: int
    refused: int
    stamp: float | None
    used: bool
    problem: str | None
    dropped: int = 0


class _Sent(NamedTuple):
    stamp: float
    T_odom_sensor: Array


class OdometryFeed:
    """The newest poses T_odom_sensor that were sent; may be used from any thread."""

    _kept: deque[_Sent]
    _suspect: _Sent | None
    _problem: str | None

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._left, self._counted = MOST_PER_SECOND, time.monotonic()
        self.clear()

    def put(self, stamp: float, T_odom_sensor: ArrayLike, limits: LocalizationSettings) -> bool:
        """Take a pose (3,), m, m, rad, at a stamp, s on the clock of the scans: for a live sensor, Unix time.

        False if it was dropped, because more than MOST_PER_SECOND came.

        Raises MotionError if the clock went back or the pose moved faster than the limits allow; it is left out then.
        The next one may go on from it, which is what follows a reset, or from what came before.
        """
        with self._lock:
            if not self._admits():
                self._dropped += 1
                return False
            now = _Sent(stamp, np.asarray(T_odom_sensor, float))
            if fault := self._kept and _fault(self._kept[-1], now, limits):
                if self._suspect is None or _fault(self._suspect, now, limits):
                    self._suspect = now
                    self._refused += 1
                    raise MotionError(
                        f"{fault}: it was left out; the next pose is compared with this one, too."
                    )
                self._kept.clear()
                self._kept.append(self._suspect)
            self._suspect = None
            self._kept.append(now)
            self._taken += 1
        return True

    def _admits(self) -> bool:
        """A second's worth may come at once; then, as many as time gives back."""
        now = time.monotonic()
        self._left = min(self._left + (now - self._counted) * MOST_PER_SECOND, MOST_PER_SECOND)
        self._counted = now
        admits = self._left >= 1
        self._left -= admits
        return admits

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._kept = deque(maxlen=KEPT)
            self._suspect = None
            self._taken = self._refused = self._dropped = 0
            self._used, self._problem = False, "No scan has been processed since."

    def at(self, stamp: float) -> Array | None:
        """T_odom_sensor (3,) at the stamp, carried on from the newest poses if it is a little later; else None."""
        with self._lock:
            found = _at(self._kept, stamp) if self._kept else None
            self._used = found is not None
            self._problem = None if self._used else _why_not(self._kept, stamp)
        return found

    def status(self, unused_because: str | None = None) -> OdometryStatus:
        """What was sent, and what became of it; `unused_because` says why the newest scan did not ask for any."""
        with self._lock:
            problem = unused_because or self._problem
            return OdometryStatus(
                taken=self._taken,
                refused=self._refused,
                dropped=self._dropped,
                stamp=self._kept[-1].stamp if self._kept else None,
                used=self._used and not unused_because,
                problem=problem if self._kept else None,
            )


def _fault(before: _Sent, now: _Sent, limits: LocalizationSettings) -> str | None:
    """Why a pose cannot follow another one, if so."""
    dt = now.stamp - before.stamp
    if dt < 0:
        return f"The clock of this pose went back by {-dt:.6g} s"
    increment = relative(before.T_odom_sensor, now.T_odom_sensor)
    way, turn = float(np.hypot(*increment[:2])), abs(float(increment[2]))
    judged = max(dt, LEAST)
    if way > limits.max_speed * judged or turn > limits.max_turn_rate * judged:
        return f"Odometry jumped by {way:.3g} m and {turn:.3g} rad in {dt:.3g} s to this pose"
    return None


def _at(kept: Sequence[_Sent], stamp: float) -> Array | None:
    track = PoseTrack(np.array([one.stamp for one in kept]), np.array([one.T_odom_sensor for one in kept]))
    newest, late = kept[-1], stamp - kept[-1].stamp
    if late <= 0 or len(kept) < 2:
        return track.at(stamp)
    if late > AHEAD or (pair := track.at(newest.stamp - late)) is None:
        return None
    return compose(newest.T_odom_sensor, relative(pair, newest.T_odom_sensor))


def _why_not(kept: Sequence[_Sent], stamp: float) -> str | None:
    """Why nothing is known at a stamp; None if nothing was sent."""
    if not kept:
        return None
    ahead = kept[-1].stamp - stamp
    if stamp < kept[0].stamp:
        return f"Odometry is stamped {ahead:.1f} s ahead of the scans: use the clock of the scans."
    if -ahead > AHEAD:
        return f"Odometry is stamped {-ahead:.1f} s behind the scans: use the clock of the scans, and keep sending."
    return "There is too little odometry yet to extrapolate."
