"""What the line-based laser logs share: the geometry of a SICK, markers for no return, stamps."""

from abc import abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterator, Set
from functools import partial
from heapq import heappop, heappush
from typing import ClassVar, NamedTuple

import numpy as np

from lidarcore.files.streams import lines
from lidarcore.geometry import compose
from lidarcore.recordings.base import Recording
from lidarcore.recordings.laser_survey import SICK_RANGE, Survey
from lidarcore.recordings.pace import period
from lidarcore.scan import Array, Scan

SICK_STEPS = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5, 400: 0.25, 401: 0.25}
"""Degrees between the beams of a SICK LMS by their number (CARMEN, carmen_laser_guess_angle_increment)."""


_MOST_LATE = (
    100  # lines, and more are not a line that was written late: the clock was set, or logs were joined
)


class Reading(NamedTuple):
    """One laser line: ranges (N,) m, no return from max_range m on; bearings (N,) rad, None if as of a SICK.

    stamps are candidates in s, best first; pose and base_pose (3,) are of the sensor and of the robot; truth (3,) is
    T_world_sensor where somebody corrected it.
    """

    topic: str
    ranges: Array
    bearings: Array | None
    max_range: float
    stamps: tuple[float, ...]
    pose: Array | None = None
    base_pose: Array | None = None
    quality: Array | None = None
    truth: Array | None = None


def numbers(words: list[bytes], count: int) -> Array:
    """Read the first `count` words as numbers (count,). Raises ValueError if they are not there."""
    if not 0 <= count <= len(words):
        raise ValueError(f"{count} numbers announced, {len(words)} found")
    return np.array([float(word) for word in words[:count]], np.float64)


def sick_bearings(number: int) -> Array:
    """Bearings (number,) rad of a SICK LMS, from the right: 180 degrees, or 100 with 400 or 401 beams.

    Any other number of beams is taken to span 180 degrees, as CARMEN does.
    """
    start = -50.0 if number in (400, 401) else -90.0
    step = SICK_STEPS.get(number, 180 / max(number - 1, 1))
    return np.deg2rad(start + step * np.arange(number, dtype=np.float64))


class LaserLog(Recording):
    """A text log with one line for each scan, as they were taken: a logger may write some a few lines late.

    A last line that does not end is kept if the format can tell that it is whole, or if it is the only scan.
    Opening reads the file once: for the lidars in it, the marker for no return and the quality of the stamps.
    """

    implied: ClassVar[Set[int]] = SICK_STEPS.keys()
    """Numbers of beams whose bearings the format implies; of others, the sensor may be another one."""

    @abstractmethod
    def _parse(self, words: list[bytes]) -> Reading | None:
        """Read a line; None if it is not a laser's. Raises ValueError or IndexError if it is damaged."""

    _late = 0  # lines by which one may stand too late in the file
    _beam_times: Array | None = None  # (N,) s after a scan's stamp at which its beams are taken, if known

    def _open(self, topic: str | None) -> None:
        surveys: defaultdict[str, Survey] = defaultdict(Survey)
        for reading in self._readings():
            survey = surveys[reading.topic]
            survey.add(
                reading.ranges, reading.stamps, reading.pose, has_bearings=reading.bearings is not None
            )
            if reading.pose is not None and reading.base_pose is not None:
                survey.mounting.add(reading.base_pose, reading.pose)
        if not surveys:
            raise self._error("holds no readable laser line.")
        self._choose(self._distinct(set(surveys)), topic)
        self._learn(surveys[str(self.topic)])

    def _distinct(self, topics: set[str]) -> set[str]:
        """Topics without those that repeat another one."""
        return topics

    def _learn(self, survey: Survey) -> None:
        """Learn from all readings of the chosen lidar what a single one does not say."""
        if unknown := survey.beams - self.implied:
            beams = max(unknown)
            span = np.degrees(np.ptp(sick_bearings(beams)))
            self._remark(f"The log gives no angles: {beams} beams are taken to span {span:.4g} degrees.")
        self._marker = self._find_marker(survey)
        self._stamps = self._settle_stamps(survey)

    def _is_whole(self, line: bytes) -> bool:
        """Whether a last line without an end surely lacks nothing, not even digits of its last number."""
        return False

    def _is_kept(self, line: bytes) -> bool:
        """Whether a last line without an end is taken: it has to be whole, unless it is all there is."""
        if self._has_reading:
            return self._is_whole(line)
        self._remark("The last line does not end: its last number may be cut.")
        return True

    def _readings(self) -> Iterator[Reading]:
        self._has_reading = False
        with self._stream() as stream:
            for line in lines(stream, self._remark, self._is_kept):
                try:
                    reading = self._parse(line.split())
                except (ValueError, IndexError):
                    self._count("damaged lines left out", 1)
                else:
                    if reading is not None:
                        self._has_reading = True
                        yield reading

    def _find_marker(self, survey: Survey) -> float:
        """Reading in m from which on there was no return.

        Some logs hold a clipped value (50.0, 51.15) for it. That is the largest reading, and it occurs more
        often than all others of the last metre together, which true ranges do not.
        """
        if survey.ties < 10 or 2 * survey.ties <= survey.last_metre():
            return SICK_RANGE
        largest = f"exactly {survey.largest:.6g} m, the largest"
        self._remark(f"{survey.ties} readings are {largest}: taken to mean no return.")
        return survey.largest

    def _settle_stamps(self, survey: Survey) -> Array:
        """Stamps (N,) s: of those that readings may have, the first kind that mostly grows, or file order."""
        candidates = survey.stamps()
        for stamps in candidates.T:
            steps = np.diff(stamps)
            if np.isfinite(stamps).all() and stamps.any() and (len(steps) == 0 or np.median(steps) > 0):
                if backward := int(np.sum(steps < 0)):
                    self._late = _latest(stamps)
                    often = "once" if backward == 1 else f"{backward} times"
                    mended = ": scans are put in their order" if self._late else ""
                    self._remark(f"The stamps go back in time {often}{mended}.")
                return np.array(stamps, np.float64)
        seconds = period(survey.poses())
        self._remark(f"The stamps are zero or rounded: scans are taken in file order, {seconds:g} s apart.")
        return seconds * np.arange(len(candidates), dtype=np.float64)

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        chosen = (reading for reading in self._readings() if reading.topic == self.topic)
        waiting: list[
            tuple[float, int, Reading]
        ] = []  # with the numbers of their lines, as stamps may be the same
        for number, (reading, stamp) in enumerate(zip(chosen, self._stamps, strict=False)):
            heappush(waiting, (float(stamp), number, reading))
            if len(waiting) > self._late:
                yield self._first_of(waiting)
        while waiting:
            yield self._first_of(waiting)

    def _first_of(self, waiting: list[tuple[float, int, Reading]]) -> Callable[[], Scan]:
        stamp, _, reading = heappop(waiting)
        return partial(self._scan, reading, stamp)

    def _scan(self, reading: Reading, stamp: float) -> Scan:
        missing = reading.ranges >= min(self._marker, reading.max_range)
        self._count("readings at or beyond the largest range taken as missing", int(missing.sum()))
        ranges = np.where(missing, np.nan, reading.ranges)
        bearings = sick_bearings(len(ranges)) if reading.bearings is None else reading.bearings
        odometry = self._odometry(reading, stamp)
        return Scan(ranges, bearings, stamp, reading.quality, self._beam_times, odometry, truth=reading.truth)

    def _odometry(self, reading: Reading, stamp: float) -> Array | None:
        """T_odom_sensor (3,) of a reading: as it says, or by where the robot was and the sensor sits on it."""
        base_pose = self._base_pose(reading, stamp)
        if base_pose is None or self.T_base_sensor is None:
            return base_pose
        return compose(base_pose, self.T_base_sensor)

    def _base_pose(self, reading: Reading, stamp: float) -> Array | None:
        """T_odom_base (3,) of a reading; that of the sensor where the log knows no robot."""
        return reading.pose


def _latest(stamps: Array) -> int:
    """How many lines too late the latest one stands among its stamps (N,); 0 if that is too many."""
    places = np.argsort(stamps, kind="stable")
    late = int(np.abs(places - np.arange(len(places))).max(initial=0))
    return late if late <= _MOST_LATE else 0
