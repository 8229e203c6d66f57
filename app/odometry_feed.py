"""Odometry that another program sends, and what it says about the moment of a scan."""

import threading
from collections import deque
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from app.wire import OdometryStateJson
from lidarcore.errors import MotionError
from lidarcore.localization import LocalizationSettings
from lidarcore.poses import PoseTrack, compose, inverse
from lidarcore.scan import Array

KEPT = 500  # poses, of the newest
AHEAD = 0.3  # s that a scan may be newer than the newest pose
LEAST = 0.02  # s over which a speed is judged at least: stamps jitter
MAX_COORDINATE = 1e6  # m, of a pose that is sent: what is seen from there can still be put into a map
MAX_STAMP = 1e12  # s; more is surely another unit


Finite = Annotated[float, Field(allow_inf_nan=False)]
Coordinate = Annotated[Finite, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, description="m")]


class OdometryPose(BaseModel):
    """T_odom_sensor at a stamp, s on the clock of the scans: for a live sensor, Unix time."""

    model_config = ConfigDict(extra="forbid")
    stamp: Annotated[Finite, Field(ge=-MAX_STAMP, le=MAX_STAMP, description="s")]
    x: Coordinate
    y: Coordinate
    heading: Annotated[Finite, Field(description="rad")]


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
        self.clear()

    def put(self, pose: OdometryPose, limits: LocalizationSettings) -> None:
        """Take a pose.

        Raises MotionError if the clock went back or the pose moved faster than the limits allow; it is left out then.
        The next one may go on from it, which is what follows a reset, or from what came before.
        """
        now = _Sent(pose.stamp, np.array([pose.x, pose.y, pose.heading]))
        with self._lock:
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

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._kept = deque(maxlen=KEPT)
            self._suspect = None
            self._taken = self._refused = 0
            self._used, self._problem = False, "No scan has been processed since."

    def at(self, stamp: float) -> Array | None:
        """T_odom_sensor (3,) at the stamp, carried on from the newest poses if it is a little later; else None."""
        with self._lock:
            found = _at(self._kept, stamp) if self._kept else None
            self._used = found is not None
            self._problem = None if self._used else _why_not(self._kept, stamp)
        return found

    def state(self, unasked: str | None = None) -> OdometryStateJson:
        """What was sent, and what became of it; `unasked` says why the newest scan did not ask for any."""
        with self._lock:
            problem = unasked or self._problem
            return {
                "taken": self._taken,
                "refused": self._refused,
                "stamp": self._kept[-1].stamp if self._kept else None,
                "used": self._used and not unasked,
                "problem": problem if self._kept else None,
            }


def _fault(before: _Sent, now: _Sent, limits: LocalizationSettings) -> str | None:
    """Why a pose cannot follow another one, if so."""
    dt = now.stamp - before.stamp
    if dt < 0:
        return f"The clock of this pose went back by {-dt:.6g} s"
    increment = compose(inverse(before.T_odom_sensor), now.T_odom_sensor)
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
    return compose(newest.T_odom_sensor, compose(inverse(pair), newest.T_odom_sensor))


def _why_not(kept: Sequence[_Sent], stamp: float) -> str | None:
    """Why nothing is known at a stamp; None if nothing was sent."""
    if not kept:
        return None
    ahead = kept[-1].stamp - stamp
    if stamp < kept[0].stamp:
        return f"The stamps of odometry are {ahead:.1f} s ahead of the scans: stamp it by their clock."
    if -ahead > AHEAD:
        return f"The stamps of odometry are {-ahead:.1f} s behind the scans: stamp it by their clock, go on sending."
    return "There is too little odometry yet to go on from."
