"""Logs of a tracked LEGO robot from C. Brenner's SLAM course: S lines are scans, M lines encoders.

Format: lego_robot.py of the course. Scans and encoders may be in one file, or in two: *_scan.txt and *_motors.txt.
"""

import re
from pathlib import Path

import numpy as np

from lidarcore.poses import PoseTrack, compose
from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.streams import lines, open_stream
from lidarcore.scan import Array

_STEP, _MIDDLE, _MOUNTING = 0.006135923151543, 330, -0.06981317  # rad, beam, rad
_AHEAD = 0.030  # m from the robot's centre to the scanner
_NEAREST = 0.02  # m, below which a reading is an error code
_TICK, _TRACK_WIDTH = 0.349e-3, 0.155  # m, as the robot's maker measured them: the heading drifts with it
_BESIDE = 0.5  # s that a scan may lie before the first or after the last encoder line


class LegoLog(LaserLog):
    """A LEGO robot's log. T_odom_sensor is dead reckoning from the encoders, as raw as it comes."""

    name = "LEGO robot log"
    signature = re.compile(rb"^S \d+ (\d+)( \d+){100}", re.MULTILINE)

    def _open(self, topic: str | None) -> None:
        self._encoders: list[Array] = []
        self._track: PoseTrack | None = None
        super()._open(topic)

    def _survey(self, readings: list[Reading]) -> None:
        super()._survey(readings)
        motors = self.path.with_name(self.path.name.replace("_scan", "_motors"))
        if not self._encoders and motors.is_file():
            self._read_motors(motors)
        self.T_base_sensor = np.array([_AHEAD, 0.0, 0.0])
        encoders = np.array(self._encoders).reshape(-1, 3)
        if len(encoders):
            self._first, self._last = encoders[0, 0], encoders[-1, 0]
        else:
            self._remark(f"No encoders in the log, and no {motors.name} beside it: there is no odometry.")
        self._track = PoseTrack(encoders[:, 0], _dead_reckoning(encoders[:, 1:]))

    def _read_motors(self, path: Path) -> None:
        with open_stream(path, self._remark) as stream:
            for line in lines(stream, self._remark):
                self._parse(line.split())

    def _parse(self, words: list[bytes]) -> Reading | None:
        kind = words[0] if words else b""
        if kind == b"M" and self._track is None:
            stamp, left, right = (float(words[i]) for i in (1, 2, 6))
            self._encoders.append(np.array([stamp / 1000, left, right]))
        if kind != b"S":
            return None
        ranges: Array = numbers(words[3:], int(words[2])) / 1000
        bearings: Array = _STEP * (np.arange(len(ranges), dtype=np.float64) - _MIDDLE) + _MOUNTING
        ranges[ranges < _NEAREST] = np.nan
        return Reading("S", ranges, bearings, np.inf, (float(words[1]) / 1000,))

    def _odometry(self, reading: Reading, stamp: float) -> Array | None:
        if not self._track or not self._first - _BESIDE <= stamp <= self._last + _BESIDE:
            return None
        base_pose = self._track.at(min(max(stamp, self._first), self._last))
        return None if base_pose is None else compose(base_pose, np.array([_AHEAD, 0.0, 0.0]))


def _dead_reckoning(ticks: Array) -> Array:
    """Poses (M, 3) of the robot's centre from ticks (M, 2) of the left and right track, along arcs."""
    left, right = np.diff(ticks, axis=0, prepend=ticks[:1]).T * _TICK
    turns = (right - left) / _TRACK_WIDTH
    headings = np.cumsum(turns)
    steps = (left + right) / 2 * np.sinc(turns / (2 * np.pi)) * np.exp(1j * (headings - turns / 2))
    positions = np.cumsum(steps)
    return np.stack([positions.real, positions.imag, headings], -1)
