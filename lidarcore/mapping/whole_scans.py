"""SLAM from whole scans: each one is laid on the last keyframes at once, and the map behind is bent meanwhile."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.clusters import Clusters
from lidarcore.errors import LocalizationError, MotionError
from lidarcore.features import Features
from lidarcore.geometry import UncertainPose, relative
from lidarcore.localization import Estimate, Landmarks, Points, TrackingResult, Velocity
from lidarcore.localization.dead_reckoning import DeadReckoning
from lidarcore.localization.deskewing import Distortion
from lidarcore.localization.ekf.estimate import Instant, no_innovation
from lidarcore.localization.tracking_result import State, goes_on
from lidarcore.mapping.front import FrontEnd, Tracked
from lidarcore.mapping.map_worker import MapPicture, MapWorker
from lidarcore.mapping.settings import VAGUE, MapperSettings
from lidarcore.mapping.walls import Walls
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings

_NOT_CONNECTED = "The scan lies on nothing known: odometry or the last motion alone says where the sensor is."
_ISLAND = (
    "After a break without odometry the sensor may be in several places: what is mapped now is joined to what was "
    "mapped before once it comes to a place that it has seen."
)
_NOT_PLACED = "A map of whole scans begins where its first scan was taken and cannot be moved."
_HERE = UncertainPose(np.zeros(3), np.zeros((3, 3)))
_NONE = Points(np.empty((0, 2)), np.eye(2))
_NO_LANDMARKS = Landmarks.of(_NONE)
_PAUSE = 1.0  # s between scans, over which the motion between them does not tell the velocity


class WholeScans:
    """Says where each scan was taken, and builds the map of them in the background; used as a `Navigator` is.

    extraction  noise of the sensor, and how walls are found
    begin_map   called where a map begins; what it gives is called with the walls each time that they were found, in a
                thread of its own

    A thread runs until `close`.
    """

    def __init__(
        self,
        extraction: ExtractionSettings | None = None,
        begin_map: Callable[[], Callable[[Walls], None]] | None = None,
    ) -> None:
        self._begin_map = begin_map
        self._extraction = extraction = extraction or ExtractionSettings()
        self._settings = MapperSettings().with_noise(extraction.noise)
        self._distortion, self._reckoning = Distortion(), DeadReckoning()
        self._last: tuple[float, Array] | None = None  # stamp and T_map_sensor
        self._velocity: Velocity | None = None
        self._begin()

    @property
    def deskewed_by(self) -> tuple[float, Velocity]:
        """Stamp of the scan that was deskewed last, NaN if none was, and the velocity that was taken out of it."""
        return self._distortion.stamp, self._distortion.velocity

    @property
    def picture(self) -> MapPicture | None:
        """Grid and walls as they are now; None until there are any."""
        return self._worker.picture

    @property
    def is_behind(self) -> bool:
        """Whether keyframes wait to be joined to the map."""
        return self._worker.is_behind

    def path(self) -> Array:
        """(T, 2) m: where the keyframes were taken, as the map has them now, and the newest scan."""
        known = self._worker.corrected.poses
        newer = [pose.pose[:2] for pose in self._chain(len(known) - 1, len(self._ways))[1:]]
        here = [] if self._last is None else [self._last[1][:2]]
        return np.array([*known[:, :2], *newer, *here])

    def place(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Raises LocalizationError: the map begins at its first scan, and cannot be moved."""
        raise LocalizationError(_NOT_PLACED)

    def deskewed(self, scan: Scan) -> Scan:
        """The scan without the distortion by the sensor's motion, by odometry, else by the motion so far."""
        return self._distortion.remove(scan, self._reckoning.velocity(scan) or self._velocity)

    def step(
        self, scan: Scan, features: Features | None = None, clusters: Clusters | None = None
    ) -> TrackingResult:
        """Place a scan that `deskewed` gave. After a break of clock or odometry the map begins anew."""
        try:
            tracked, message = self._front.step(scan, self._removed(scan)), None
        except MotionError as error:
            self.end()
            self._begin()
            tracked, message = self._front.step(scan, self._removed(scan)), goes_on(error)
        here = self._located(tracked)
        self._reckon(scan, here.pose)
        why = None if tracked.on else _NOT_CONNECTED
        if here.covariance[2, 2] > VAGUE**2:
            why = _ISLAND
        state: State = "lost" if why else "tracking"
        return self._result(tracked.stamp, state, message or why, here)

    def _removed(self, scan: Scan) -> Array:
        """Velocity (3,) m/s, m/s, rad/s that `deskewed` took out of the scan."""
        v, w, u = self._distortion.velocity if self._distortion.stamp == scan.stamp else (0.0, 0.0, 0.0)
        return np.array([v, u, w])

    def end(self) -> None:
        """Take no more scans; returns at once."""
        self._worker.end()

    def close(self) -> None:
        """End, and wait for what runs in the background."""
        self._worker.close()

    def _begin(self) -> None:
        self._front = FrontEnd(self._settings.front)
        self._worker = MapWorker(self._settings, self._extraction, self._begin_map and self._begin_map())
        self._ways: list[UncertainPose] = []  # to each keyframe from the one before it
        self._last = self._velocity = None

    def _located(self, tracked: Tracked) -> UncertainPose:
        """T_map_sensor: by the map as far as it has come, and from there from keyframe to keyframe."""
        tie = tracked.tie
        if tracked.keyframe:
            self._ways.append(UncertainPose(tie.pose, tie.covariance + self._settings.drift_covariance))
            self._worker.put(tracked)
            tie = _HERE
        known = len(self._worker.corrected.poses)
        return self._chain(known - 1, len(self._ways))[-1].compose(tie)

    def _chain(self, first: int, end: int) -> list[UncertainPose]:
        """Poses of keyframes, of which the first is the last that the map has."""
        known = self._worker.corrected
        poses = [UncertainPose(known.poses[first], known.covariance)]
        for way in self._ways[first + 1 : end]:
            poses.append(poses[-1].compose(way))
        return poses

    def _reckon(self, scan: Scan, pose: Array) -> None:
        """Remember how the sensor moved: the next scan is deskewed by that."""
        self._velocity = None
        if self._last is not None and 0 < (dt := scan.stamp - self._last[0]) <= _PAUSE:
            x, y, turn = (relative(self._last[1], pose) / dt).tolist()
            self._velocity = x, turn, y
        self._last = scan.stamp, pose
        self._reckoning.carry(Instant(scan.stamp, scan.odometry), pose)

    def _result(self, stamp: float, state: State, message: str | None, here: UncertainPose) -> TrackingResult:
        v, w, u = self._velocity or (0.0, 0.0, 0.0)
        velocity = None if self._velocity is None else np.array([v, w])
        estimate = Estimate(stamp, here.pose, here.covariance, velocity, no_innovation(0), u)
        return TrackingResult.of(
            stamp,
            "slam",
            state,
            message,
            estimate,
            _NONE,
            _NO_LANDMARKS,
            _NO_LANDMARKS,
            self._reckoning.pose,
        )
