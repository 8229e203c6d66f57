"""Logs of the RPLidar-SLAMbot, a tracked robot with an RPLIDAR A1: encoders and one range for each degree.

Format: examples/*.log of AerospaceRobotics/RPLidar-SLAMbot, constants from its components.py.
"""

import re

import numpy as np

from lidarcore.arrays import Array
from lidarcore.recordings.laser_log import Reading, numbers
from lidarcore.recordings.laser_survey import Survey
from lidarcore.recordings.tick_log import TickLog

_DEGREES: Array = np.arange(360, dtype=np.float64)  # clockwise, in the order in which they are taken


class SlambotLog(TickLog):
    """A line for each scan: ticks left and right (16 bits), ms (16 bits), mm at 0, 1, ... 359 degrees clockwise."""

    name, sensor = "SLAMbot log", "RPLIDAR A1"
    signature = re.compile(rb"\A-?\d+ -?\d+ \d+( \d+){100}")
    tick, track_width = 0.90 * np.pi * 0.0582 * 3 / 1000, 0.190  # tracks slip, a turn has 1000 / 3 ticks
    ahead, bits = -0.035, 16
    turned = _DEGREES / 360

    def _settle_stamps(self, survey: Survey) -> Array:
        """Stamps (N,) s: the counter wraps every 65.5 s and only goes on."""
        candidates = survey.stamps()
        steps = np.diff(candidates[:, 0]) % 2**16
        return np.cumsum(np.append(candidates[:1, 0], steps)) / 1000

    def _parse(self, words: list[bytes]) -> Reading | None:
        if not words:
            return None
        left, right, milliseconds, *ranges = numbers(words, 3 + len(_DEGREES))
        self._count_ticks(left, right)
        return Reading("scans", np.array(ranges) / 1000, -np.deg2rad(_DEGREES), np.inf, (milliseconds,))
