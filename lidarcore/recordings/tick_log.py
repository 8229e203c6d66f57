"""What laser logs share that hold, beside each scan, the counts of a robot's two encoders."""

from array import array
from typing import ClassVar

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import PoseTrack
from lidarcore.recordings.encoders import dead_reckoning, unwrapped
from lidarcore.recordings.laser_log import LaserLog, Reading
from lidarcore.recordings.laser_survey import Survey

_FASTEST = 10.0  # m/s, above which a side's encoder has jumped: some robots drive at 3


class TickLog(LaserLog):
    """T_odom_sensor is dead reckoning from the encoders. Over a jump, as when they are reset, the robot stands.

    Stamps are those of the lines. A line seems to be written a revolution after its scan was taken, with the counts of
    then: maps learn that as odometry which is ahead of the scans.
    """

    tick: ClassVar[float]
    """m that a side of the robot moves in a tick of its encoder."""
    track_width: ClassVar[float]
    """m between the sides."""
    ahead: ClassVar[float]
    """m from the turning centre to the lidar."""
    bits: ClassVar[int] = 32
    """Of a counter, after which it wraps."""
    turned: ClassVar[Array]
    """(N,) shares of a revolution that the lidar has made when it takes each beam; it makes one for each line."""

    def _open(self, topic: str | None) -> None:
        self._counters = array("d")
        self._track: PoseTrack | None = None
        super()._open(topic)

    def _count_ticks(self, left: float, right: float) -> None:
        """Take up the counters of a line while the log is read for the first time."""
        if self._track is None:
            self._counters.extend((left, right))

    def _learn(self, survey: Survey) -> None:
        super()._learn(survey)
        self.T_base_sensor = np.array([self.ahead, 0.0, 0.0])
        if len(self._stamps) > 1:
            self._beam_times = self.turned * np.median(np.diff(self._stamps))
        ticks = self._without_jumps(np.frombuffer(self._counters).reshape(-1, 2))
        self._track = PoseTrack(self._stamps, dead_reckoning(ticks, self.tick, self.track_width))

    def _without_jumps(self, ticks: Array) -> Array:
        """Ticks (N, 2) that never wrap, with steps of none where a side would have been too fast.

        Stamps of lines that were held up are too close together: none of them tells of a speed that is too high.
        """
        steps, took = np.diff(unwrapped(ticks, self.bits), axis=0), np.diff(self._stamps)
        took = np.maximum(took, np.median(took)) if len(took) else took
        jumped = np.abs(steps).max(axis=1) * self.tick > _FASTEST * took
        if jumped.any():
            often = "1 time" if jumped.sum() == 1 else f"{jumped.sum()} times"
            self._remark(f"The encoders jumped {often}: the robot is taken to stand meanwhile.")
        return np.cumsum(np.concatenate([ticks[:1], np.where(jumped[:, None], 0, steps)]), axis=0)

    def _base_pose(self, reading: Reading, stamp: float) -> Array | None:
        return self._track.at(stamp) if self._track else None
