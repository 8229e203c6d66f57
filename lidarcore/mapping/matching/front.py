"""The front end: registers each scan on the surfaces of the last keyframes, in a local frame that loops never bend."""

from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import HERE, UncertainPose
from lidarcore.mapping.matching.expectation import Expectation
from lidarcore.mapping.matching.local_map import SURE, LocalMap, is_blind
from lidarcore.mapping.matching.patches import Patches, patches
from lidarcore.mapping.matching.prediction import Prediction
from lidarcore.mapping.matching.registration import Registration
from lidarcore.mapping.matching.standing import Standing
from lidarcore.mapping.motion.sweep import NOTHING, PAUSE, Sweep, is_swept, without
from lidarcore.mapping.settings import VAGUE, FrontSettings
from lidarcore.mapping.tracked import Tracked
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan

_ROUNDS = 4  # in which the motion in the first two scans is found: what is left of it halves at least
_BAD = 0.4  # share of a scan on the map below which it is a keyframe, as it shows what is new


class FrontEnd:
    """Takes scans one by one. Odometry is used where scans have it, else the motion is taken to go on."""

    def __init__(self, settings: FrontSettings) -> None:
        self._settings = settings
        self._scans = self._number = 0  # number of scans, and of keyframes
        self._map = LocalMap(settings)
        self._known = self._moved = HERE  # T_keyframe_scan, and by motion alone
        self._first: Tracked | None = None  # until the second scan
        self._prediction = Prediction(settings)
        self._sweep = Sweep()
        self._standing = Standing(settings)

    @property
    def bridged(self) -> MotionError | None:
        """The break of clock or odometry before the last scan, over which the map goes on; None if there is none."""
        return self._prediction.bridged

    @property
    def wheels(self) -> Array:
        """(4,) what odometry does wrong at every step, as far as it is known now."""
        return self._prediction.wheels

    def take_noise(self, noise: SensorNoise) -> None:
        """Scans to come have that noise; those in the map keep what they were seen with."""
        self._settings = replace(self._settings, match=replace(self._settings.match, noise=noise))

    def step(self, scan: Scan, removed: Array | None = None) -> Tracked:
        """Place a scan; removed (3,) m/s, m/s, rad/s is the motion that was taken out of it already.

        Raises MotionError if the clock went back or odometry jumped, and the scan is left out. The third one in a row
        is believed: clock and odometry go on from there, and what the scan sees tells how the sensor moved meanwhile.
        """
        if not self._scans:
            return self._begun(scan, removed)
        dt, driven = self._prediction.step(scan)
        first, self._first = self._first, None
        if first is not None:
            self._prediction.begin_at_any_speed(dt)
            first = self._straightened(first, scan, removed, driven, dt)
            dt, driven = self._prediction.again(scan)
        guess = self._known.compose(driven)
        moved = self._moved.compose(self._prediction.farther(driven, scan))
        wheels = driven.pose / dt if scan.odometry is not None and dt > 0 else None
        expected = self._map.expects(guess)
        scan, seen, registered = self._registered(self._sweep.remove(scan, wheels, removed), expected, dt)
        matched, tie, on = self._judged(scan, seen, guess, expected, registered)
        sees = not is_blind(seen)
        island = sees and not on and bool(tie.covariance[2, 2] > VAGUE**2)
        self._prediction.go_on(scan, self._known, guess, matched, dt, on)
        self._known, self._moved = tie, moved
        tie = UncertainPose(tie.pose, tie.covariance + self._prediction.astray)
        leaves = island or (sees and self._leaves(tie[0], registered.inliers))
        is_view = on and not leaves and self._standing.is_due(scan.stamp, tie.pose)
        taken = None if wheels is None else self._prediction.taken(tie.pose)
        tracked = Tracked(
            self._scans, scan.stamp, self._number - 1, tie, moved, taken, on, scan, seen, self._sweep.covariance,
            self._sweep.removed, leaves, is_view, island, first,
        )  # fmt: skip
        self._scans += 1
        if leaves:
            if on and wheels is not None:
                self._prediction.learn(moved, matched)
            if island:
                self._map.clear()
            self._begin(scan, seen, tie.pose)
        return tracked

    def _begun(self, scan: Scan, removed: Array | None) -> Tracked:
        """The first scan, where the map begins."""
        seen = patches(scan, self._settings.match)
        self._prediction.begin(scan)
        self._begin(scan, seen)
        given = np.zeros(3) if removed is None else removed
        self._first = Tracked(
            0, scan.stamp, 0, HERE, HERE, None, True, scan, seen, NOTHING, given, True, False, False
        )
        self._scans = 1
        return self._first

    def _registered(self, scan: Scan, expected: Expectation, dt: float) -> tuple[Scan, Patches, Registration]:
        """The scan on the local map, once more without the motion that it shows there."""
        seen = patches(scan, self._settings.match)
        registered = self._map.registered(scan, seen, expected)
        if registered.inliers >= SURE and dt > 0:
            corrected = self._sweep.correct(scan, self._known.pose, self._map.tie(registered).pose, dt)
            if corrected is not scan:
                scan, seen = corrected, patches(corrected, self._settings.match)
                registered = self._map.registered_from(registered.pose, seen, expected, settled=True)
        return scan, seen, registered

    def _judged(
        self,
        scan: Scan,
        seen: Patches,
        guess: UncertainPose,
        expected: Expectation,
        registered: Registration,
    ) -> tuple[UncertainPose, UncertainPose, bool]:
        """Where it was matched, or guessed; the same as uncertain as it stands; and whether it lies on the map."""
        rival = self._map.rival(scan, seen, expected, registered)
        is_chance = self._map.is_chance(seen, expected, registered)
        on = registered.inliers >= self._settings.inliers and not is_chance and rival is None
        matched = guess
        if on:
            pose, P = self._map.tie(registered)
            matched = UncertainPose(pose, P + self._map.scatter(seen, expected, registered))
        if rival is not None:
            return matched, self._map.either(registered, rival), on
        return matched, UncertainPose(matched.pose, matched.covariance + self._sweep.covariance), on

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
            seen = patches(still, self._settings.match)
            registered = self._map.registered(still, seen, self._map.expects(driven))
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
            self._prediction.begin_at(dt * straight.velocity)
            self._sweep.begin(straight.scan, straight.velocity)
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
        self._prediction.leave()
        self._standing.begin(scan.stamp)
        self._number += 1

    def _leaves(self, pose: Array, inliers: float) -> bool:
        """True if a scan at this pose from its keyframe is to be one itself."""
        s = self._settings
        far = np.hypot(*pose[:2]) >= s.keyframe_distance or abs(pose[2]) >= s.keyframe_turn
        return bool(far or inliers < _BAD)
