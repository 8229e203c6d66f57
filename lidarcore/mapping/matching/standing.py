"""When a sensor that stands is heard again: what comes and goes around it belongs in the map, too."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.mapping.settings import FrontSettings

_STILL = 0.1  # share of the motion between keyframes up to which a sensor stands


class Standing:
    """Tells which scans of a sensor that stands the map should take, beside its keyframes."""

    def __init__(self, settings: FrontSettings) -> None:
        self._settings = settings
        self._since = -np.inf  # s, when a scan was last taken or the sensor moved
        self._pose = np.zeros(3)  # T_keyframe_sensor then

    def begin(self, stamp: float) -> None:
        """A scan is a keyframe: what follows is seen from it."""
        self._since, self._pose = stamp, np.zeros(3)

    def is_due(self, stamp: float, pose: Array) -> bool:
        """Whether the map should take a scan at a pose (3,), T_keyframe_sensor, that is no keyframe."""
        s, off = self._settings, pose - self._pose
        moves = np.hypot(*off[:2]) > _STILL * s.keyframe_distance or abs(off[2]) > _STILL * s.keyframe_turn
        is_due = not moves and stamp - self._since >= s.standing
        if moves or is_due:
            self._since, self._pose = stamp, pose
        return is_due
