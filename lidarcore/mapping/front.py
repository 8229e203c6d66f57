"""The front end: registers each scan on the surfaces of the last keyframes, in a local frame that loops never bend."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MotionError
from lidarcore.geometry import UncertainPose, compose, pose_difference, relative
from lidarcore.mapping.correlative import search
from lidarcore.mapping.patches import Patches, patches
from lidarcore.mapping.registration import Registration, information_of, register
from lidarcore.mapping.settings import VAGUE, FrontSettings
from lidarcore.mapping.surfels import Surfels, surfels
from lidarcore.mapping.sweep import NOTHING, PAUSE, Sweep, is_swept, without
from lidarcore.scan import Scan

_HERE = UncertainPose(np.zeros(3), np.zeros((3, 3)))
_FLOOR = np.diag([0.01, 0.01, 0.005]) ** 2  # what a step is never known better than: the search needs room
_BLIND = 20  # patches: nothing can be registered on a scan that has fewer
_SLOW = 0.1  # weight of the last scan in the usual time between two
_FURTHER = 3.0  # times as far is looked for a scan that does not fit
_SURE = 0.6  # share of a scan on the map from which on it needs no search
_TURNED = 0.25  # rad from which on two poses are not the same
_WIDE = 0.5  # m by which a point may be off where the search is needed in any case
_BETTER = 0.02  # share of a scan by which a pose that was searched for must fit better than that of the guess
_RIVAL = 0.85  # of the share of a scan on the map, from which on another pose is a rival
_RIVALS = 3  # other poses that are looked at
_ROUNDS = 4  # in which the motion in the first two scans is found: what is left of it halves at least
_BAD = 0.4  # share of a scan on the map below which it is a keyframe, as it shows what is new


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """Where a scan was taken, in the local frame.

    stamp     s
    node      number of the keyframe that the scan hangs on; its own if it is one
    tie       T_node_scan (3,) with its covariance (3, 3), of the keyframe before if the scan is one itself
    moved     T_node_scan as far as motion alone tells: odometry, or the going on of the motion
    on        False if it lies on nothing known: only odometry or the last motion says where it is
    scan      as a sensor would see it that stood still at its stamp
    patches   of the scan
    sweep     (3, 3) how far the scan may stand from where the sensor was at its stamp, a part of tie's covariance
    velocity  (3,) m/s, m/s, rad/s that was taken out of the scan
    keyframe  whether the scan is one
    island    True if it lies on nothing known, or fits in several places, and its heading is vague: how it, and what
              follows, lies to what was before is open
    first     the first keyframe anew, now that the motion in it is known; told once, with the second one
    """

    stamp: float
    node: int
    tie: UncertainPose
    moved: UncertainPose
    on: bool
    scan: Scan
    patches: Patches
    sweep: Array
    velocity: Array
    keyframe: bool
    island: bool
    first: "Tracked | None" = None


class FrontEnd:
    """Takes scans one by one. Odometry is used where scans have it, else the motion is taken to go on."""

    def __init__(self, settings: FrontSettings) -> None:
        self._settings = settings
        self._number = 0
        self._window: deque[tuple[Patches, Array]] = deque(maxlen=settings.keyframes)
        self._map: Surfels | None = None
        self._anchor = np.zeros(3)  # T_local_keyframe
        self._known = self._moved = _HERE  # T_keyframe_scan, and by motion alone
        self._before: tuple[float, Array | None] | None = None  # stamp and odometry
        self._first: Tracked | None = None  # until the second keyframe
        self._sweep = Sweep()
        self._motion, self._period = np.zeros(3), 0.0  # s between scans, as stamps of single scans jitter

    def step(self, scan: Scan, removed: Array | None = None) -> Tracked:
        """Place a scan; removed (3,) m/s, m/s, rad/s is the motion that was taken out of it already.

        Raises MotionError if the clock went back or odometry jumped; nothing has changed then.
        """
        if self._before is None:
            seen = patches(scan, self._settings.match)
            self._before = scan.stamp, scan.odometry
            self._begin(seen)
            given = np.zeros(3) if removed is None else removed
            self._first = Tracked(scan.stamp, 0, _HERE, _HERE, True, scan, seen, NOTHING, given, True, False)
            return self._first
        dt, driven = self._since(scan)
        if self._first is not None and self._before[0] == self._first.stamp:
            self._first = self._straightened(self._first, scan, removed, driven, dt)
            dt, driven = self._since(scan)
        guess, moved = self._known.compose(driven), self._moved.compose(driven)
        wheels = driven.pose / dt if scan.odometry is not None and dt > 0 else None
        scan = self._sweep.remove(scan, wheels, removed)
        seen = patches(scan, self._settings.match)
        registered = self._registered(seen, guess)
        if registered.inliers >= _SURE and dt > 0:
            found = relative(self._known.pose, self._tie(registered).pose) / dt
            corrected = self._sweep.correct(scan, found, dt)
            if corrected is not scan:
                scan, seen = corrected, patches(corrected, self._settings.match)
                registered = self._registered_again(seen, guess, registered.pose)
        rival = self._rival(seen, guess, registered)
        on = registered.inliers >= self._settings.inliers and rival is None
        tie = self._tie(registered) if on else guess
        tie = UncertainPose(tie.pose, tie.covariance + self._sweep.covariance)
        if rival is not None:
            tie = self._either(registered, rival)
        island = len(seen.means) >= _BLIND and not on and bool(tie.covariance[2, 2] > VAGUE**2)
        self._motion = relative(self._known.pose, tie.pose) if on else np.zeros(3)
        self._period += _SLOW * (dt - self._period)
        self._known, self._moved, self._before = tie, moved, (scan.stamp, scan.odometry)
        leaves = island or (len(seen.means) >= _BLIND and self._leaves(tie[0], registered.inliers))
        tracked = Tracked(
            scan.stamp, self._number - 1, tie, moved, on, scan, seen, self._sweep.covariance,
            self._sweep.removed, leaves, island, self._first if leaves else None,
        )  # fmt: skip
        if leaves:
            self._first = None
            self._anchor = compose(self._anchor, tie[0])
            if island:
                self._window.clear()
            self._begin(seen)
        return tracked

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
            registered = self._registered(
                patches(without(scan, velocity - given), self._settings.match), driven
            )
            if registered.inliers < _SURE:
                straight = first
                break
            velocity = registered.pose / dt
            bare = without(first.scan, velocity - first.velocity)
            straight = replace(
                first, scan=bare, patches=patches(bare, self._settings.match), velocity=velocity
            )
            self._begin_anew(straight.patches)
        self._begin_anew(straight.patches)
        if straight is not first:
            self._motion = dt * straight.velocity
            self._sweep.begin(straight.velocity)
        return straight

    def _begin_anew(self, seen: Patches) -> None:
        """The first scan is another one."""
        self._window.clear()
        self._number = 0
        self._begin(seen)

    def _begin(self, seen: Patches) -> None:
        """The scan is a keyframe: the map is made anew."""
        self._window.append((seen, self._anchor))
        scans, poses = zip(*self._window, strict=True)
        match = self._settings.match
        self._map = surfels(scans, np.array(poses), match.patch, match.reach)
        self._known = self._moved = _HERE
        self._number += 1

    def _since(self, scan: Scan) -> tuple[float, UncertainPose]:
        """Seconds since the last scan, and the motion: by odometry, else as before."""
        assert self._before is not None
        s, (stamp, odometry) = self._settings, self._before
        dt = scan.stamp - stamp
        if dt < 0:
            raise MotionError(f"The clock went back by {-dt:g} s: leave the scan out, or begin a new map.")
        if scan.odometry is None or odometry is None:
            change = max(dt, self._period) * np.array([s.speed_change, s.speed_change, s.turn_change])
            return dt, UncertainPose(self._motion, np.diag(change**2) + _FLOOR)
        motion = relative(odometry, scan.odometry)
        if (way := float(np.hypot(*motion[:2]))) > (most := s.max_step * max(dt, 1.0)):
            raise MotionError(
                f"Odometry jumped by {way:.3g} m in {dt:.3g} s, more than {most:.3g} m: leave the scan out, or raise "
                f"max_step from {s.max_step:g} m."
            )
        return dt, UncertainPose(motion, s.odometry.covariance(motion) + _FLOOR)

    def _registered(self, seen: Patches, guess: UncertainPose) -> Registration:
        """The scan on the local map: from the guess on, and after a search where the guess is vague or does not fit."""
        assert self._map is not None
        match, (x, P) = self._settings.match, UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        prior = information_of(P)
        sigma = np.sqrt(np.diagonal(P))
        far = np.percentile(np.hypot(*seen.means.T), 80) if len(seen.means) else 0.0
        registered = register(self._map, seen, x, x, prior, match.reach)
        if registered.inliers < _SURE or 3 * (np.hypot(sigma[0], sigma[1]) + far * sigma[2]) > _WIDE:
            registered = self._searched(seen, x, sigma, prior, registered)
        if registered.inliers < _SURE:
            registered = self._searched(seen, x, _FURTHER * sigma, prior, registered)
        return registered

    def _registered_again(self, seen: Patches, guess: UncertainPose, pose: Array) -> Registration:
        """The scan on the local map, from a pose near the right one."""
        assert self._map is not None
        x, P = UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        return register(self._map, seen, pose, x, information_of(P), self._settings.match.reach)

    def _searched(
        self, seen: Patches, x: Array, sigma: Array, prior: Array, registered: Registration
    ) -> Registration:
        """The better one of where the scan was registered and where a search finds it."""
        assert self._map is not None
        match = self._settings.match
        start = search(self._map.means, seen.means, x, sigma, match)
        other = register(self._map, seen, start, x, prior, match.reach)
        return other if other.inliers > registered.inliers + _BETTER else registered

    def _rival(self, seen: Patches, guess: UncertainPose, registered: Registration) -> Array | None:
        """Another pose (3,) at which a scan that fits badly fits nearly as well, if the guess leaves it open."""
        assert self._map is not None
        if not self._settings.inliers <= registered.inliers < _SURE or len(seen.means) < _BLIND:
            return None
        match, (x, P) = self._settings.match, UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        sigma, prior, besides = np.sqrt(np.diagonal(P)), information_of(P), registered.pose[None]
        if 3 * np.hypot(sigma[0], sigma[1]) < _WIDE:
            return None
        for _ in range(_RIVALS):
            start = search(self._map.means, seen.means, x, sigma, match, besides)
            other = register(self._map, seen, start, x, prior, match.reach)
            off = pose_difference(registered.pose, other.pose)
            if other.inliers >= _RIVAL * registered.inliers and (
                np.hypot(*off[:2]) > _WIDE or abs(off[2]) > _TURNED
            ):
                return other.pose
            besides = np.concatenate([besides, start[None]])
        return None

    def _either(self, registered: Registration, rival: Array) -> UncertainPose:
        """The pose seen from the keyframe, so uncertain that it may be the rival."""
        pose, P = self._tie(registered)
        off = pose_difference(relative(self._anchor, rival), pose)
        return UncertainPose(pose, P + np.outer(off, off) + np.diag(off**2))

    def _tie(self, registered: Registration) -> UncertainPose:
        """The pose seen from the keyframe."""
        exact = UncertainPose(self._anchor, np.zeros((3, 3)))
        return exact.relative(UncertainPose(registered.pose, information_of(registered.information)))

    def _leaves(self, pose: Array, inliers: float) -> bool:
        """True if a scan at this pose from its keyframe is to be one itself."""
        s = self._settings
        far = np.hypot(*pose[:2]) >= s.keyframe_distance or abs(pose[2]) >= s.keyframe_turn
        return bool(far or inliers < _BAD)
