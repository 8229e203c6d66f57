"""The pose from whole scans: each one is matched to the last keyframes at once, and the map behind catches up."""

from collections import deque
from collections.abc import Callable
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.clusters import Clusters
from lidarcore.errors import MotionError
from lidarcore.features import Features
from lidarcore.geometry import HERE, UncertainPose, as_pose_covariance, inverse, relative
from lidarcore.localization import Estimate, Landmarks, Points, TrackingResult, Velocity, as_pose
from lidarcore.localization.dead_reckoning import DeadReckoning
from lidarcore.localization.deskewing import Distortion
from lidarcore.localization.ekf.estimate import Instant, no_innovation
from lidarcore.localization.tracking_result import State, goes_on, left_out
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.live.background import Background, Corrected, MapPicture
from lidarcore.mapping.live.locate_worker import LocateWorker
from lidarcore.mapping.live.map_worker import MapWorker
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.motion.sweep import PAUSE, elapsed
from lidarcore.mapping.settings import MapperSettings
from lidarcore.mapping.tracked import Tracked
from lidarcore.mapping.walls import Walls
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings

_NONE = Points(np.empty((0, 2)), np.eye(2))
_NO_LANDMARKS = Landmarks.of(_NONE)


class WholeScans:
    """Says where each scan was taken, in a map that it builds of them or in a known one; used as a `Navigator` is.

        with closing(WholeScans(known=MapPicture(read_ros_map("hall.yaml")), background=False)) as tracker:
            for scan in open_recording(path):
                found = tracker.step(tracker.deskewed(scan))

    extraction  noise of the sensor, and how walls are found
    begin_map   called where a map begins; what it gives is called with grid and walls each time that these were found,
                in a thread of its own
    known       the map to localize in, from no guess of the pose or one that `place` tells; without, one is built
    background  whether a known map is searched in a thread of its own: scans never wait, and the pose comes later

    Threads run until `close`.
    """

    def __init__(
        self,
        extraction: ExtractionSettings | None = None,
        begin_map: Callable[[], Callable[[OccupancyGrid, Walls], None]] | None = None,
        known: MapPicture | None = None,
        background: bool = True,
    ) -> None:
        self._begin_map, self._known, self._in_background = begin_map, known, background
        self._extraction = extraction or ExtractionSettings()
        self._settings = MapperSettings().with_noise(self._extraction.noise)
        self._distortion, self._reckoning = Distortion(), DeadReckoning()
        self._is_nowhere = False  # in a known map, as long as the pose was not found
        self._state: State = "starting"
        self._front = FrontEnd(self._settings.front)
        self._background = self._begun()
        # To each keyframe from the one before it, but for those that the map has already, so many.
        self._ways, self._joined = deque[UncertainPose](), 0
        self._tie = HERE  # T_keyframe_sensor
        self._here: UncertainPose | None = None
        self._before: float | None = None  # stamp of the last scan
        self._velocity: Velocity | None = None

    @property
    def deskewed_by(self) -> tuple[float, Velocity]:
        """Stamp of the scan that was deskewed last, NaN if none was, and the velocity that was taken out of it."""
        return self._distortion.stamp, self._distortion.velocity

    @property
    def picture(self) -> MapPicture | None:
        """Grid and walls as they are known now; None until there are any."""
        return self._background.picture

    @property
    def is_behind(self) -> bool:
        """Whether keyframes wait to be joined to the map."""
        return self._background.is_behind

    def path(self) -> Array:
        """(T, 2) m: where the keyframes were taken, as the map has them now, and the newest scan.

        In a known map the last kilometres of a long drive.
        """
        known = self._background.corrected
        newer = [pose.pose[:2] for pose in self._chain(known)[1:]]
        here = [] if self._here is None else [self._here.pose[:2]]
        return np.vstack([known.poses[:, :2], *newer, *here])

    def renew(self, extraction: ExtractionSettings) -> None:
        """Go on so: scans to come have that noise, and walls are found anew, if that differs from before."""
        if extraction != self._extraction:
            self._extraction = extraction
            self._front.take_noise(extraction.noise)
            self._background.renew(extraction)

    def place(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Say by hand where the sensor is in a known map: T_map_sensor (3,) m, m, rad and its covariance (3, 3).

        Raises LocalizationError if the pose is not finite or the map is built, CovarianceError if the covariance is not
        positive definite.
        """
        told = UncertainPose(as_pose(pose, "pose"), as_pose_covariance(covariance, "The pose's covariance"))
        self._background.place(told.compose(UncertainPose(inverse(self._tie.pose), np.zeros((3, 3)))))

    def deskewed(self, scan: Scan) -> Scan:
        """The scan without the distortion by the sensor's motion, by odometry, else by the motion so far."""
        return self._distortion.remove(scan, self._reckoning.velocity(scan) or self._velocity)

    def step(
        self, scan: Scan, features: Features | None = None, clusters: Clusters | None = None
    ) -> TrackingResult:
        """Place a scan that `deskewed` gave; one before which clock or odometry broke off is left out, up to two."""
        try:
            tracked = self._front.step(scan, self._removed(scan))
        except MotionError as error:
            assert self._here is not None  # the first scan has nothing to break off from
            return self._result(scan.stamp, self._state, left_out(error), self._here)
        message = None if self._front.bridged is None else goes_on(self._front.bridged)
        if message:
            self._reckoning.interrupt()
            self._before = None
        self._move(scan, tracked)
        here = self._located(tracked)
        self._reckoning.carry(Instant(scan.stamp, scan.odometry), here.pose)
        state, why = self._background.judge(tracked, here)
        if self._is_nowhere and state != "starting":  # found: odometry is compared from here on
            self._reckoning.place(here.pose)
        self._is_nowhere, self._state = state == "starting", state
        return self._result(tracked.stamp, state, message or why, here)

    def _removed(self, scan: Scan) -> Array:
        """Velocity (3,) m/s, m/s, rad/s that `deskewed` took out of the scan."""
        v, w, u = self._distortion.velocity if self._distortion.stamp == scan.stamp else (0.0, 0.0, 0.0)
        return np.array([v, u, w])

    def end(self) -> None:
        """Take no more scans; returns at once."""
        self._background.end()

    def close(self) -> None:
        """End, and wait for what runs in the background."""
        self._background.close()

    def _begun(self) -> Background:
        if self._known is not None:
            return LocateWorker(self._known, self._settings.drift_covariance, self._in_background)
        return MapWorker(self._settings, self._extraction, self._begin_map and self._begin_map())

    def _located(self, tracked: Tracked) -> UncertainPose:
        """T_map_sensor: by the map as far as it has come, and from there from keyframe to keyframe."""
        tie = tracked.tie
        if tracked.keyframe:
            self._ways.append(UncertainPose(tie.pose, tie.covariance + self._settings.drift_covariance))
            tie = HERE
        if tracked.is_news or tracked.view:
            self._background.put(tracked)
        self._tie = tie
        known = self._background.corrected
        while self._ways and self._joined < known.keyframes:
            self._ways.popleft()
            self._joined += 1
        self._here = self._chain(known)[-1].compose(tie)
        return self._here

    def _chain(self, known: Corrected) -> list[UncertainPose]:
        """Poses of the last keyframe that the map has, and of those since."""
        poses = [UncertainPose(known.poses[-1], known.covariance)]
        for way in islice(self._ways, max(known.keyframes - self._joined, 0), None):
            poses.append(poses[-1].compose(way))
        return poses

    def _move(self, scan: Scan, tracked: Tracked) -> None:
        """Remember how the sensor moved, which no bend of the map changes: the next scan is deskewed by that."""
        self._velocity = None
        if self._before is not None and 0 < (dt := elapsed(scan, self._before)) <= PAUSE:
            x, y, turn = (relative(self._tie.pose, tracked.tie.pose) / dt).tolist()
            self._velocity = x, turn, y
        self._before = scan.stamp

    def _result(self, stamp: float, state: State, message: str | None, here: UncertainPose) -> TrackingResult:
        v, w, u = self._velocity or (0.0, 0.0, 0.0)
        velocity = None if self._velocity is None else np.array([v, w])
        estimate = Estimate(stamp, here.pose, here.covariance, velocity, no_innovation(0), u)
        return TrackingResult.of(
            stamp,
            self._background.mode,
            state,
            message,
            estimate,
            _NONE,
            _NO_LANDMARKS,
            _NO_LANDMARKS,
            self._reckoning.pose,
        )
