"""Odometry that another program sends, and what it says about the moment of a scan."""

import threading
from collections import deque
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from lidarcore.errors import MotionError
from lidarcore.localization import LocalizationSettings
from lidarcore.localization.estimate import Instant
from lidarcore.poses import PoseTrack, compose, inverse
from lidarcore.scan import Array

KEPT = 500  # poses, of the newest
AHEAD = 0.3  # s that a scan may be newer than the newest pose


Finite = Annotated[float, Field(allow_inf_nan=False)]


class OdometryPose(BaseModel):
    """T_odom_sensor at a stamp, s on the clock of the scans: for a live sensor, Unix time."""

    model_config = ConfigDict(extra="forbid")
    stamp: Annotated[Finite, Field(description="s")]
    x: Annotated[Finite, Field(description="m")]
    y: Annotated[Finite, Field(description="m")]
    heading: Annotated[Finite, Field(description="rad")]


class OdometryFeed:
    """The newest poses T_odom_sensor that were sent; may be used from any thread."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Array]] = deque(maxlen=KEPT)
        self._newest: Instant | None = None
        self._lock = threading.Lock()

    def put(self, pose: OdometryPose, limits: LocalizationSettings) -> None:
        """Take a pose.

        Raises MotionError if the clock went back or the pose moved faster than the limits allow; it and what came
        before are left out then, and the next one is compared with it.
        """
        T_odom_sensor = np.array([pose.x, pose.y, pose.heading])
        now = Instant(pose.stamp, T_odom_sensor)
        with self._lock:
            before, self._newest = self._newest, now
            try:
                if before is not None:
                    before.until(now, limits)
            except MotionError:
                self._kept.clear()
                raise
            self._kept.append((pose.stamp, T_odom_sensor))

    def clear(self) -> None:
        """Forget everything: another source plays."""
        with self._lock:
            self._kept.clear()
            self._newest = None

    def at(self, stamp: float) -> Array | None:
        """T_odom_sensor (3,) at the stamp, carried on from the newest poses if it is a little later; else None."""
        with self._lock:
            kept = list(self._kept)
        if not kept:
            return None
        track = PoseTrack(np.array([s for s, _ in kept]), np.array([pose for _, pose in kept]))
        late = stamp - kept[-1][0]
        if late <= 0 or len(kept) < 2:
            return track.at(stamp)
        if late > AHEAD or (pair := track.at(kept[-1][0] - late)) is None:
            return None
        return compose(kept[-1][1], compose(inverse(pair), kept[-1][1]))
