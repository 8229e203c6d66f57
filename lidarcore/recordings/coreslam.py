"""Logs of CoreSLAM (tinySLAM) and BreezySLAM: a MinesRover with a Hokuyo URG-04LX.

Format: examples/*.dat of simondlevy/BreezySLAM, constants from its mines.py. Beams are as in the sensor's manual.
"""

import re

import numpy as np

from lidarcore.arrays import Array
from lidarcore.recordings.laser_log import Reading, numbers
from lidarcore.recordings.tick_log import TickLog

_BEFORE, _BEAMS = 25, 682  # columns before the ranges, and ranges
_LEFT, _RIGHT = 2, 3  # columns of the encoders
_NEAREST = 0.02  # m; below are codes for errors
_AHEAD = 384 - 44  # step of the sensor, of 1024 in a turn, that looks ahead, from the first one on
_STEPS: Array = np.arange(_BEAMS, dtype=np.float64)
_BEARINGS: Array = np.radians(360 / 1024 * (_STEPS - _AHEAD))


class CoreSlamLog(TickLog):
    """A line for each scan: microseconds, ticks left and right, other columns, two spaces, mm from the right on."""

    name, sensor = "CoreSLAM log", "Hokuyo URG-04LX"
    signature = re.compile(rb"\A\d+ \d+ -?\d+ -?\d+( -?[\d.]+){21}  \d+( \d+){100}")
    tick, track_width, ahead = 2 * np.pi * 0.077 / 2000, 2 * 0.165, 0.145
    turned = _STEPS / 1024

    def _parse(self, words: list[bytes]) -> Reading | None:
        if not words:
            return None
        values = numbers(words, _BEFORE + _BEAMS)
        self._count_ticks(values[_LEFT], values[_RIGHT])
        ranges = values[_BEFORE:] / 1000
        ranges[ranges < _NEAREST] = np.nan
        return Reading("scans", ranges, _BEARINGS, np.inf, (values[0] / 1e6,))
