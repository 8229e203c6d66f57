"""How long after each other scans are taken to come where a file does not say."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import relative

NOMINAL_PERIOD = 0.1
"""s between scans where nothing tells: the usual 10 Hz of a small lidar."""

_SPEED, _TURN_RATE = 1.0, 1.0  # m/s and rad/s of a robot among people
_LONGEST = 2.0  # s that a step counts, at most: a pose that jumps is no motion


def period(poses: Array) -> float:
    """s between scans that were taken at poses (T, 3) m, m, rad: as if the robot moved at 1 m/s or turned at 1 rad/s.

    Many logs keep a scan for every half metre or metre only. Taken to come ten times a second, they would tell of a
    robot of 10 m/s, and whatever expects a robot to go on as it did would be far too sure of that. Never less than
    NOMINAL_PERIOD.
    """
    steps, poses = len(poses) - 1, poses[np.isfinite(poses).all(axis=1)]
    if len(poses) < 2:
        return NOMINAL_PERIOD
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no places
        x, y, turn = relative(poses[:-1], poses[1:]).T
        took = np.maximum(np.hypot(x, y) / _SPEED, np.abs(turn) / _TURN_RATE)
    return max(round(float(np.fmin(took, _LONGEST).sum()) / steps, 2), NOMINAL_PERIOD)
