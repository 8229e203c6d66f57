"""Where the next scan should be, before it is looked at: by clock and odometry, else as the sensor went before."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import UncertainPose, relative
from lidarcore.mapping.matching.odometry_calibration import OdometryCalibration, Taken, effects
from lidarcore.mapping.matching.persistence import Persistence
from lidarcore.mapping.matching.velocity import Velocity
from lidarcore.mapping.motion.sweep import elapsed
from lidarcore.mapping.settings import FrontSettings
from lidarcore.scan import Scan

_FLOOR = np.diag([0.01, 0.01, 0.005]) ** 2  # what a step is never known better than: the search needs room
_SLOW = 0.1  # weight of the last scan in the usual time between two
_AGREEING = 3  # scans in a row, the last of which is believed though clock or odometry break off before them
_HIDDEN = 2.0  # s that such a break hides of the way, at least
_LONGEST = 10.0  # and at most: after that nothing is known
_FASTEST = 0.02  # s from scan to scan: no lidar turns faster


class _Last(NamedTuple):
    """The last scan.

    stamp     s
    odometry  (3,) its pose by that; None without
    rolled    (3,) m/s, m/s, rad/s, its velocity by that; None if unknown
    """

    stamp: float
    odometry: Array | None = None
    rolled: Array | None = None


class Prediction:
    """The motion from one scan to the next, as far as motion alone tells it.

    bridged  the break of clock or odometry before the last scan, over which the motion goes on; None if there is none
    """

    def __init__(self, settings: FrontSettings) -> None:
        self.bridged: MotionError | None = None
        self._settings = settings
        self._last: _Last | None = None
        self._velocity = Velocity()
        self._due: tuple[UncertainPose, UncertainPose, Array] | None = None  # what is learned next, see there
        self._refused = 0  # scans in a row
        self._wheels, self._motion = OdometryCalibration(), Persistence()
        self._period = 0.0  # s between scans, as stamps of single scans jitter

    @property
    def wheels(self) -> Array:
        """(4,) what odometry does wrong at every step, as far as it is known now."""
        return self._wheels.errors

    def taken(self, tie: Array) -> Taken:
        """What odometry did wrong on the way (3,) from the keyframe to the last scan, as far as it is known now."""
        return Taken(self.wheels, effects(tie, self._velocity.began, self._velocity.now))

    @property
    def astray(self) -> Array:
        """(3, 3) by how much more the pose of the last scan may be wrong than its match says."""
        return self._motion.astray

    def step(self, scan: Scan) -> tuple[float, UncertainPose]:
        """Seconds since the last scan, and the motion: by odometry, else as before.

        Raises MotionError if the clock went back or odometry jumped. The third scan in a row is believed.
        """
        self.bridged = None
        try:
            since = self.again(scan)
        except MotionError as error:
            self._refused += 1
            if self._refused < _AGREEING:
                raise
            assert self._last is not None
            hidden = min(max(abs(scan.stamp - self._last.stamp), _HIDDEN), _LONGEST)
            self.bridged, self._last = error, _Last(scan.stamp - hidden)
            since = self.again(scan)
        self._refused = 0
        return since

    def again(self, scan: Scan) -> tuple[float, UncertainPose]:
        """The same of a scan that was believed, now that more is known of the motion before it."""
        assert self._last is not None
        s, (stamp, odometry, rolled) = self._settings, self._last
        if (back := stamp - scan.stamp) > 0:
            raise MotionError(f"The clock went back by {back:g} s: leave the scan out, or begin a new map.")
        dt = elapsed(scan, stamp)
        if scan.odometry is None or odometry is None:
            return dt, UncertainPose(self._motion.step, self._change(dt) + _FLOOR)
        motion = relative(odometry, scan.odometry)
        if (way := float(np.hypot(*motion[:2]))) > (most := s.max_step * max(dt, 1.0)):
            raise MotionError(
                f"Odometry jumped by {way:.3g} m in {dt:.3g} s, more than {most:.3g} m: leave the scan out, or raise "
                f"max_step from {s.max_step:g} m."
            )
        after = self._speed(motion, dt)
        before = after if rolled is None else rolled
        motion = self._wheels.corrected(motion, before, after)
        unknown = self._wheels.unknown(motion, before, after)
        return dt, UncertainPose(motion, s.odometry.covariance(motion) + unknown + _FLOOR)

    def farther(self, driven: UncertainPose, scan: Scan) -> UncertainPose:
        """A motion as uncertain as it is where scans do not tell it for long."""
        if scan.odometry is not None:
            return driven
        return UncertainPose(driven.pose, driven.covariance + self._motion.longer)

    def begin(self, scan: Scan) -> None:
        """The way begins at this scan."""
        self._last = _Last(scan.stamp, scan.odometry)

    def begin_at_any_speed(self, dt: float) -> None:
        """The sensor may have come to the first of two scans, dt s apart, in any way."""
        self._motion.begin(np.zeros(3), self._change(dt))

    def begin_at(self, step: Array) -> None:
        """The sensor goes on by a step (3,) from scan to scan."""
        self._motion.begin(step)

    def go_on(
        self,
        scan: Scan,
        known: UncertainPose,
        guess: UncertainPose,
        found: UncertainPose,
        dt: float,
        on: bool,
    ) -> None:
        """Learn how the sensor moves, which is all that tells where it goes when neither wheels nor scans do.

        known is where the scan before was, all seen from the keyframe; on tells whether the scan lies on the map.
        """
        assert self._last is not None
        step, rolled = relative(known.pose, found.pose), None
        if scan.odometry is not None:
            self._motion.begin(step)
            if self._last.odometry is not None:
                rolled = self._speed(relative(self._last.odometry, scan.odometry), dt)
        self._velocity.step(self._speed(step, dt))
        if self._due is not None:
            self._wheels.learn(*self._due, self._velocity.between)
            self._due = None
        self._motion.find(known, guess, found, min(dt, 1.0) * self._change(dt))
        if not on:
            self._motion.stop()
        self._period += _SLOW * (dt - self._period)
        self._last = _Last(scan.stamp, scan.odometry, rolled)

    def learn(self, moved: UncertainPose, found: UncertainPose) -> None:
        """Learn what odometry does wrong from the way to a keyframe by motion alone, and by what was seen."""
        self._due = moved, found, self._velocity.began

    def leave(self) -> None:
        """What follows is seen from the last scan."""
        self._motion.leave()
        self._velocity.leave()

    def _speed(self, step: Array, dt: float) -> Array:
        """(3,) m/s, m/s, rad/s of a step (3,); stamps of single scans jitter."""
        return step / max(dt, self._period, _FASTEST)

    def _change(self, dt: float) -> Array:
        """(3, 3) of a step, by how much speeds may differ from those of the step before it."""
        s = self._settings
        change = max(dt, self._period) * np.array([s.speed_change, s.speed_change, s.turn_change])
        return np.diag(change**2)
