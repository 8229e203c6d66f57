"""The front end: registers each scan on the surfaces of the last keyframes, in a local frame that loops never bend."""

from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import HERE, UncertainPose, relative
from lidarcore.mapping.matching.local_map import BLIND, SURE, LocalMap
from lidarcore.mapping.matching.odometry_calibration import OdometryCalibration
from lidarcore.mapping.matching.patches import Patches, patches
from lidarcore.mapping.matching.persistence import Persistence
from lidarcore.mapping.matching.registration import Registration
from lidarcore.mapping.matching.standing import Standing
from lidarcore.mapping.matching.sweep import NOTHING, PAUSE, Sweep, elapsed, is_swept, without
from lidarcore.mapping.settings import VAGUE, FrontSettings
from lidarcore.mapping.tracked import Tracked
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan

_FLOOR = np.diag([0.01, 0.01, 0.005]) ** 2  # what a step is never known better than: the search needs room
_SLOW = 0.1  # weight of the last scan in the usual time between two
_ROUNDS = 4  # in which the motion in the first two scans is found: what is left of it halves at least
_AGREEING = (
    3  # scans in a row, of which the last one is believed though clock or odometry break off before them
)
_HIDDEN = 2.0  # s that such a break hides of the way, at least
_LONGEST = 10.0  # and at most: after that nothing is known
_BAD = 0.4  # share of a scan on the map below which it is a keyframe, as it shows what is new


class FrontEnd:
    """Takes scans one by one. Odometry is used where scans have it, else the motion is taken to go on."""

    def __init__(self, settings: FrontSettings) -> None:
        self._settings = settings
        self._scans = self._number = 0  # number of scans, and of keyframes
        self._map = LocalMap(settings)
        self._known = self._moved = HERE  # T_keyframe_scan, and by motion alone
        self._before: tuple[float, Array | None] | None = None  # stamp and odometry
        self._first: Tracked | None = None  # until the second scan
        self._refused = 0  # scans in a row
        self.bridged: MotionError | None = None  # the break before the last scan, over which the map goes on
        self._sweep = Sweep()
        self._wheels = OdometryCalibration()
        self._standing = Standing(settings)
        self._motion, self._period = Persistence(), 0.0  # s between scans, as stamps of single scans jitter

    def take_noise(self, noise: SensorNoise) -> None:
        """Scans to come have that noise; those in the map keep what they were seen with."""
        self._settings = replace(self._settings, match=replace(self._settings.match, noise=noise))

    def step(self, scan: Scan, removed: Array | None = None) -> Tracked:
        """Place a scan; removed (3,) m/s, m/s, rad/s is the motion that was taken out of it already.

        Raises MotionError if the clock went back or odometry jumped, and the scan is left out. The third one in a row
        is believed: clock and odometry go on from there, and what the scan sees tells how the sensor moved meanwhile.
        """
        if self._before is None:
            return self._begun(scan, removed)
        dt, driven = self._across(scan)
        first, self._first = self._first, None
        if first is not None:
            self._motion.begin(np.zeros(3), self._change(dt))  # it may have come at any speed
            first = self._straightened(first, scan, removed, driven, dt)
            dt, driven = self._since(scan)
        guess, moved = self._known.compose(driven), self._moved.compose(self._farther(driven, scan))
        wheels = driven.pose / dt if scan.odometry is not None and dt > 0 else None
        scan, seen, registered = self._registered(self._sweep.remove(scan, wheels, removed), guess, dt)
        matched, tie, on = self._judged(seen, guess, registered)
        is_blind = len(seen.near.means) < BLIND
        island = not is_blind and not on and bool(tie.covariance[2, 2] > VAGUE**2)
        self._go_on(scan, guess, matched, dt, on)
        self._known, self._moved, self._before = tie, moved, (scan.stamp, scan.odometry)
        tie = UncertainPose(tie.pose, tie.covariance + self._motion.astray)
        leaves = island or (not is_blind and self._leaves(tie[0], registered.inliers))
        is_view = on and not leaves and self._standing.is_due(scan.stamp, tie.pose)
        taken = None if wheels is None else self.wheels
        tracked = Tracked(
            self._scans, scan.stamp, self._number - 1, tie, moved, taken, on, scan, seen, self._sweep.covariance,
            self._sweep.removed, leaves, is_view, island, first,
        )  # fmt: skip
        self._scans += 1
        if leaves:
            if on and wheels is not None:
                self._wheels.learn(moved, matched)
            if island:
                self._map.clear()
            self._begin(scan, seen, tie.pose)
        return tracked

    def _begun(self, scan: Scan, removed: Array | None) -> Tracked:
        """The first scan, where the map begins."""
        seen = patches(scan, self._settings.match)
        self._before = scan.stamp, scan.odometry
        self._begin(scan, seen)
        given = np.zeros(3) if removed is None else removed
        self._first = Tracked(
            0, scan.stamp, 0, HERE, HERE, None, True, scan, seen, NOTHING, given, True, False, False
        )
        self._scans = 1
        return self._first

    def _registered(self, scan: Scan, guess: UncertainPose, dt: float) -> tuple[Scan, Patches, Registration]:
        """The scan on the local map, once more without the motion that it shows there."""
        seen = patches(scan, self._settings.match)
        registered = self._map.registered(scan, seen, guess)
        if registered.inliers >= SURE and dt > 0:
            found = relative(self._known.pose, self._map.tie(registered).pose) / dt
            corrected = self._sweep.correct(scan, found, dt)
            if corrected is not scan:
                scan, seen = corrected, patches(corrected, self._settings.match)
                registered = self._map.registered_again(seen, guess, registered.pose)
        return scan, seen, registered

    def _judged(
        self, seen: Patches, guess: UncertainPose, registered: Registration
    ) -> tuple[UncertainPose, UncertainPose, bool]:
        """Where it was matched, or guessed; the same as uncertain as it stands; and whether it lies on the map."""
        rival = self._map.rival(seen, guess, registered)
        is_chance = self._map.is_chance(seen, guess, registered)
        on = registered.inliers >= self._settings.inliers and not is_chance and rival is None
        matched = guess
        if on:
            pose, P = self._map.tie(registered)
            matched = UncertainPose(pose, P + self._map.scatter(seen, guess, registered))
        if rival is not None:
            return matched, self._map.either(registered, rival), on
        return matched, UncertainPose(matched.pose, matched.covariance + self._sweep.covariance), on

    @property
    def wheels(self) -> Array:
        """(3,) what odometry does wrong at every step, as far as it is known now."""
        return self._wheels.errors

    def _straightened(
        self, first: Tracked, scan: Scan, removed: Array | None, driven: UncertainPose, dt: float
    ) -> Tracked:
        """The first keyframe without the motion that the second scan shows; as it was if that does not tell.

        Motion does to both scans the same, so the way between them hardly depends on what was taken out of both.
        """
        if not (is_swept(first.scan) and is_swept(scan) and 0 < dt <= PAUSE):
            return first
        given, velocity = np.zeros(3) if removed is None else removed, first.velocity
        straight = first
        for _ in range(_ROUNDS):
            still = without(scan, velocity - given)
            registered = self._map.registered(still, patches(still, self._settings.match), driven)
            if registered.inliers < SURE:
                straight = first
                break
            velocity = registered.pose / dt
            bare = without(first.scan, velocity - first.velocity)
            straight = replace(
                first, scan=bare, patches=patches(bare, self._settings.match), velocity=velocity
            )
            self._begin_anew(straight)
        self._begin_anew(straight)
        if straight is not first:
            self._motion.begin(dt * straight.velocity)
            self._sweep.begin(straight.velocity)
        return straight

    def _begin_anew(self, first: Tracked) -> None:
        """The first scan is another one."""
        self._map.clear()
        self._number = 0
        self._begin(first.scan, first.patches)

    def _begin(self, scan: Scan, seen: Patches, tie: Array | None = None) -> None:
        """The scan is a keyframe, at a pose (3,) from the one before it."""
        self._map.add(scan, seen, tie)
        self._known = self._moved = HERE
        self._motion.leave()
        self._standing.begin(scan.stamp)
        self._number += 1

    def _across(self, scan: Scan) -> tuple[float, UncertainPose]:
        """As `_since`, but that breaks of clock or odometry end with the third scan that they would leave out."""
        self.bridged = None
        try:
            since = self._since(scan)
        except MotionError as error:
            self._refused += 1
            if self._refused < _AGREEING:
                raise
            assert self._before is not None
            hidden = min(max(abs(scan.stamp - self._before[0]), _HIDDEN), _LONGEST)
            self.bridged, self._before = error, (scan.stamp - hidden, None)
            since = self._since(scan)
        self._refused = 0
        return since

    def _since(self, scan: Scan) -> tuple[float, UncertainPose]:
        """Seconds since the last scan, and the motion: by odometry, else as before."""
        assert self._before is not None
        s, (stamp, odometry) = self._settings, self._before
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
        motion = self._wheels.corrected(motion)
        return dt, UncertainPose(motion, s.odometry.covariance(motion) + _FLOOR)

    def _farther(self, driven: UncertainPose, scan: Scan) -> UncertainPose:
        """A motion as uncertain as it is where scans do not tell it for long."""
        if scan.odometry is not None:
            return driven
        return UncertainPose(driven.pose, driven.covariance + self._motion.longer)

    def _go_on(self, scan: Scan, guess: UncertainPose, found: UncertainPose, dt: float, on: bool) -> None:
        """Learn how the sensor moves, which is all that tells where it goes when neither wheels nor scans do."""
        if scan.odometry is not None:
            self._motion.begin(relative(self._known.pose, found.pose))
        self._motion.find(self._known, guess, found, min(dt, 1.0) * self._change(dt))
        if not on:
            self._motion.stop()
        self._period += _SLOW * (dt - self._period)

    def _change(self, dt: float) -> Array:
        """(3, 3) of a step, by how much speeds may differ from those of the step before it."""
        s = self._settings
        change = max(dt, self._period) * np.array([s.speed_change, s.speed_change, s.turn_change])
        return np.diag(change**2)

    def _leaves(self, pose: Array, inliers: float) -> bool:
        """True if a scan at this pose from its keyframe is to be one itself."""
        s = self._settings
        far = np.hypot(*pose[:2]) >= s.keyframe_distance or abs(pose[2]) >= s.keyframe_turn
        return bool(far or inliers < _BAD)
