"""Logs of the RPLidar-SLAMbot, a tracked robot with an RPLIDAR A1: encoders and one range for each degree.

Format: examples/*.log of AerospaceRobotics/RPLidar-SLAMbot, constants from its components.py.
"""

import re
from array import array

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import PoseTrack
from lidarcore.recordings.encoders import dead_reckoning, unwrapped
from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import Survey

_DEGREES = 360
_TICK, _TRACK_WIDTH = 0.90 * np.pi * 0.0582 * 3 / 1000, 0.190  # m; tracks slip, a turn has 1000 / 3 ticks
_AHEAD = -0.035  # m from the turning centre to the lidar
_FASTEST = 3.0  # m/s, above which a track's encoder has jumped


class SlambotLog(LaserLog):
    """A line for each scan: ticks left and right (16 bits), ms (16 bits), mm at 0, 1, ... 359 degrees clockwise.

    T_odom_sensor is dead reckoning from the encoders. Over a jump, as when they are reset, the robot stands.
    """

    name, sensor = "SLAMbot log", "RPLIDAR A1"
    signature = re.compile(rb"\A-?\d+ -?\d+ \d+( \d+){100}")

    def _open(self, topic: str | None) -> None:
        self._counters = array("d")
        self._track: PoseTrack | None = None
        super()._open(topic)

    def _learn(self, survey: Survey) -> None:
        super()._learn(survey)
        self.T_base_sensor = np.array([_AHEAD, 0.0, 0.0])
        ticks = np.frombuffer(self._counters).reshape(-1, 2)
        self._track = PoseTrack(self._stamps, dead_reckoning(self._without_jumps(ticks), _TICK, _TRACK_WIDTH))

    def _settle_stamps(self, survey: Survey) -> Array:
        """Stamps (N,) s: the counter wraps every 65.5 s and only goes on."""
        candidates = survey.stamps()
        steps = np.diff(candidates[:, 0]) % 2**16
        return np.cumsum(np.append(candidates[:1, 0], steps)) / 1000

    def _without_jumps(self, ticks: Array) -> Array:
        """Ticks (N, 2) that never wrap, with steps of none where a track would have been too fast."""
        steps = np.diff(unwrapped(ticks, 16), axis=0)
        jumped = np.abs(steps).max(axis=1) * _TICK > _FASTEST * np.diff(self._stamps)
        if jumped.any():
            self._remark(f"The encoders jumped {jumped.sum()} times: the robot is taken to stand meanwhile.")
        return np.cumsum(np.concatenate([ticks[:1], np.where(jumped[:, None], 0, steps)]), axis=0)

    def _parse(self, words: list[bytes]) -> Reading | None:
        if not words:
            return None
        left, right, milliseconds, *ranges = numbers(words, 3 + _DEGREES)
        if self._track is None:
            self._counters.extend((left, right))
        bearings = -np.deg2rad(np.arange(_DEGREES, dtype=np.float64))
        return Reading("scans", np.array(ranges) / 1000, bearings, np.inf, (milliseconds,))

    def _base_pose(self, reading: Reading, stamp: float) -> Array | None:
        return self._track.at(stamp) if self._track else None
