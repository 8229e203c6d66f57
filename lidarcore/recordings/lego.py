"""Logs of a tracked LEGO robot from C. Brenner's SLAM course: S lines are scans, M encoders, P a reference.

Format: lego_robot.py of the course. All may be in one file, or in three: *_scan.txt, *_motors.txt, *_reference.txt.
"""

import re
from array import array
from collections import defaultdict
from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.files.streams import lines, open_stream
from lidarcore.geometry import PoseTrack
from lidarcore.recordings.encoders import dead_reckoning
from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import Survey
from lidarcore.scan import Scan

# The scanner has 682 steps and sends lines of 32; the recorder lost the last of each, so that 660 are left. Without
# them walls bend: seen from 278 poses at once, they are straight to 8 mm like this and to 12 mm with even steps.
_STEP, _MIDDLE, _MOUNTING = 2 * np.pi / 1024, 340, -0.06981317  # rad, step, rad
_KEPT = 31  # of 32
_AHEAD = 0.030  # m from the robot's centre to the scanner
_COLUMNS = {b"M": (1, 2, 6), b"P": (1, 2, 3)}  # stamp in ms, then ticks left and right, or x and y in mm
_NEAREST = 0.02  # m, below which a reading is an error code
_TICK, _TRACK_WIDTH = 0.349e-3, 0.155  # m, as the robot's maker measured them: the heading drifts with it
_MOST_ROWS = 1_000_000  # of a kind: a day of them
_BESIDE = 0.5  # s that a scan may lie before the first or after the last encoder line


class LegoLog(LaserLog):
    """A LEGO robot's log. T_odom_sensor is dead reckoning from the encoders, as raw as it comes.

    The truth of a scan is the reference's position at its stamp, in the frame and scale of the reference.
    """

    name = "LEGO robot log"
    signature = re.compile(rb"^S \d+ (\d+)( \d+){100}", re.MULTILINE)

    def _open(self, topic: str | None) -> None:
        self._tables: defaultdict[bytes, array[float]] = defaultdict(lambda: array("d"))
        self._track: PoseTrack | None = None
        super()._open(topic)

    def _learn(self, survey: Survey) -> None:
        super()._learn(survey)
        self.T_base_sensor = np.array([_AHEAD, 0.0, 0.0])
        encoders, reference = self._table(b"M", "_motors"), self._table(b"P", "_reference")
        if len(encoders):
            self._first, self._last = encoders[0, 0], encoders[-1, 0]
        else:
            self._remark("No encoders in the log, and no *_motors.txt beside it: there is no odometry.")
        self._reference = PoseTrack(reference[:, 0], np.column_stack([reference[:, 1:], 0 * reference[:, 0]]))
        self._track = PoseTrack(encoders[:, 0], dead_reckoning(encoders[:, 1:], _TICK, _TRACK_WIDTH))

    def _table(self, kind: bytes, suffix: str) -> Array:
        """Rows (M, 3) of a kind: from the log itself, or else from the file beside it."""
        beside = self.path.with_name(self.path.name.replace("_scan", suffix))
        if not self._tables[kind] and beside.is_file():
            with open_stream(beside, self._remark) as stream:
                for line in lines(stream, self._remark):
                    try:
                        self._parse(line.split())
                    except (ValueError, IndexError):
                        self._remark(f"Damaged lines of {beside.name} are left out.")
        return np.array(self._tables.pop(kind, [])).reshape(-1, 3)

    def _parse(self, words: list[bytes]) -> Reading | None:
        kind = words[0] if words else b""
        if kind in _COLUMNS and self._track is None:
            stamp, *values = (float(words[i]) for i in _COLUMNS[kind])
            if len(self._tables[kind]) < 3 * _MOST_ROWS:
                self._tables[kind].extend((stamp / 1000, *values))
            else:
                self._count("encoder or reference lines beyond a million left out", 1)
        if kind != b"S":
            return None
        ranges: Array = numbers(words[3:], int(words[2])) / 1000
        kept = np.arange(len(ranges))
        bearings: Array = np.float64(_STEP) * (kept + kept // _KEPT - _MIDDLE) + _MOUNTING
        ranges[ranges < _NEAREST] = np.nan
        return Reading("S", ranges, bearings, np.inf, (float(words[1]) / 1000,))

    def _scan(self, reading: Reading, stamp: float) -> Scan:
        scan, place = super()._scan(reading, stamp), self._reference.at(stamp)
        return scan if place is None else replace(scan, truth=np.array([*place[:2] / 1000, np.nan]))

    def _base_pose(self, reading: Reading, stamp: float) -> Array | None:
        if not self._track or not self._first - _BESIDE <= stamp <= self._last + _BESIDE:
            return None
        return self._track.at(min(max(stamp, self._first), self._last))
