"""One thing to drive: scans in, tracking results out, in a known map or while building it."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.clusters import Clusters
from lidarcore.errors import LocalizationError, LostError, MotionError
from lidarcore.features import Features
from lidarcore.localization.continuity import Continuity
from lidarcore.localization.dead_reckoning import DeadReckoning, Velocity
from lidarcore.localization.deskewing import Distortion
from lidarcore.localization.divergence import DivergenceCheck
from lidarcore.localization.ekf.estimate import Estimate, Instant, as_pose, no_innovation
from lidarcore.localization.ekf.filters import Filter, find, is_recognisable, make_filter
from lidarcore.localization.ekf.motion import start
from lidarcore.localization.ekf.slam import ORIGIN, Slam
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.map_origin import MapOrigin
from lidarcore.localization.observations import Observations
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings, NavigationSettings
from lidarcore.localization.tracking_result import (
    NEW_MAP,
    NO_ODOMETRY,
    STATE_MESSAGES,
    State,
    TrackingResult,
    goes_on,
    left_out,
)
from lidarcore.localization.visibility import Visibility
from lidarcore.scan import Scan

_NOWHERE = np.diag([10.0, 10.0, np.pi]) ** 2  # m², m², rad²: covariance of a pose of which nothing is known
_STRAY = 0.1  # m; if a gap may hide more of the way, landmarks could be taken for their neighbours
_NOTHING = Landmarks.of(Points(np.empty((0, 2)), np.eye(2)))


class Navigator:
    """Tracks T_world_sensor over scans, and finds it again when it is lost.

    settings          mode "slam" builds the map, "localize" uses one that is given; what serves as landmarks
    landmarks         the map to localize in, or for SLAM to go on with; mode "localize" needs one
    pose, covariance  (3,) m, m, rad and (3, 3) of the start. Without them SLAM starts at the origin of a new map,
                      and in a known one the pose is found from the first scan that allows it

    Raises LocalizationError if mode is "off", a map is missing, or the pose is not finite; CovarianceError if the
    covariance is not positive definite.

    >>> import numpy as np
    >>> from lidarcore import Scan, extract
    >>> from lidarcore.localization import NavigationSettings, Navigator
    >>> bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    >>> ranges = 2 / np.maximum(abs(np.cos(bearings)), abs(np.sin(bearings)))
    >>> navigator = Navigator(NavigationSettings(mode="slam"))
    >>> for stamp in (0.0, 0.5, 1.0, 1.5, 2.0):
    ...     scan = navigator.deskewed(Scan(ranges, bearings, stamp=stamp))
    ...     result = navigator.step(scan, extract(scan))
    >>> result.state, len(result.landmarks), result.estimate.covariance.shape
    ('tracking', 4, (3, 3))
    """

    def __init__(
        self,
        settings: NavigationSettings,
        landmarks: Landmarks | Points | None = None,
        pose: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
    ) -> None:
        if settings.mode == "off":
            raise LocalizationError('Navigation is off: set mode to "localize" or "slam".')
        self.mode, self.settings = settings.mode, settings
        self._given = Landmarks.of(landmarks) if isinstance(landmarks, Points) else landmarks or _NOTHING
        if self.mode == "localize" and not self._given.confirmed.any():
            raise LocalizationError(
                "There is no map to localize in: give its landmarks, or build it by SLAM."
            )
        self._filter: Filter | None = None
        self._start: tuple[Array, Array]
        self._estimate: Estimate
        self._continuity, self._origin = Continuity(), MapOrigin()
        self._divergence, self._reckoning = DivergenceCheck(), DeadReckoning()
        self._state: State = "starting"
        self._strayed = False  # in a gap: which landmark is which is to be made sure of first
        self._distortion = Distortion()
        self._is_placed = pose is not None or len(self._given) == 0
        nowhere = ORIGIN if self._is_placed else _NOWHERE
        self._set_start((0, 0, 0) if pose is None else pose, nowhere if covariance is None else covariance)

    @property
    def landmarks(self) -> Landmarks:
        """The map as it is now."""
        return self._origin.landmarks(self._map)

    @property
    def _map(self) -> Landmarks:
        """The map in the frame in which it was started, without the uncertainty of that frame in the world."""
        return self._given if self._filter is None else self._filter.map

    def place(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Say by hand where the sensor is: T_world_sensor (3,) m, m, rad, with its covariance (3, 3).

        Raises LocalizationError if the pose is not finite, CovarianceError if the covariance is not positive definite.
        """
        self._set_start(pose, covariance)
        if self._filter is not None:
            self._filter.reset(*self._start)
            self._filter.restart_clock()
        self._reckoning.place(self._estimate.pose)
        self._is_placed, self._strayed = True, False
        self._divergence.restart()

    def deskewed(self, scan: Scan) -> Scan:
        """The scan without the distortion by the sensor's motion, as far as that is known.

        `step` takes into account by which velocity, so features are to be found in the scan that this returns.
        """
        return self._distortion.remove(scan, self._velocity(scan))

    @property
    def deskewed_by(self) -> tuple[float, Velocity]:
        """Stamp of the scan that was deskewed last, NaN if none was, and the velocity that was taken out of it."""
        return self._distortion.stamp, self._distortion.velocity

    def step(
        self,
        scan: Scan,
        features: Features,
        clusters: Clusters | None = None,
        odometry: ArrayLike | None = None,
    ) -> TrackingResult:
        """Take one scan with what was found in it; odometry is T_odom_sensor (3,), by default that of the scan.

        A scan whose clock went back, or whose odometry is missing, not finite or has jumped, is left out, and the
        message says so; once a few agree with each other, tracking continues from the new values, or without odometry.
        Raises LocalizationError if the settings ask for clusters and there are none.
        """
        observations = Observations.of(scan, features, clusters, self.settings)
        odometry = scan.odometry if odometry is None else odometry
        before = self._map
        try:
            now = Instant(scan.stamp, None if odometry is None else np.asarray(odometry, np.float64))
            message = self._advance(now, observations, scan)
        except LocalizationError as error:
            message = left_out(error)
            self._estimate = self._estimate.unmoved(len(observations.points))
            self._coast()
        return TrackingResult.of(
            scan.stamp,
            self.mode,
            self._state,
            message,
            self._origin.estimate(self._estimate),
            observations.points,
            before,
            self.landmarks,
            self._reckoning.pose,
        )

    def _advance(self, now: Instant, observations: Observations, scan: Scan) -> str | None:
        """Step the filter, across a break of clock or odometry if need be; what is to be said about it."""
        running, message = self._running(now), None
        if (hidden := self._continuity.hidden(now, running.settings)) is not None:
            running.displace(np.zeros(3), hidden)
            self._strayed |= bool(np.trace(hidden[:2, :2]) > _STRAY**2) and is_recognisable(running)
        if not self._is_placed and (trouble := self._find(running, observations.points)):
            pose, seen = self._estimate.pose, len(observations.points)
            self._estimate = Estimate(now.stamp, pose, _NOWHERE, None, no_innovation(seen))
            self._reckoning.carry(now, pose)
            return trouble
        try:
            self._continuity.check(now)
            estimate = self._estimated(running, now, observations, scan)
        except MotionError as error:
            bridge = self._continuity.reject(now, running.settings)
            if bridge is None:
                raise
            running.displace(bridge.increment, bridge.covariance)
            running.restart_clock()
            self._reckoning.interrupt()
            estimate = self._estimated(running, now, observations, scan)
            message = goes_on(error)
        self._continuity.accept(now)
        self._reckoning.carry(now, estimate.pose)
        self._estimate = estimate
        told = self._judge(running), message or self._about_odometry(running, now)
        return " ".join(filter(None, told)) or None

    def _running(self, now: Instant) -> Filter:
        """The filter, made at the first scan; moved by odometry if there is any and the settings allow."""
        if self._filter is None:
            self._filter = make_filter(self.settings, now.odometry is not None, *self._start, self._given)
        used = self._filter.settings.motion
        motion = self._continuity.motion(now, used)
        if self.settings.motion != "constant velocity" and motion != used:
            self._filter.drive_by(motion)
        return self._filter

    def _find(self, running: Filter, observed: Points) -> str | None:
        """Look for the pose in the map; what is to be said if it is not found."""
        try:
            pose, _ = find(running, observed)
        except LostError as error:
            return str(error)
        running.restart_clock()
        if self._state == "starting":
            self._reckoning.interrupt()
            self._reckoning.place(pose)
        self._is_placed, self._state = True, "tracking"
        self._divergence.restart()
        return None

    def _estimated(self, running: Filter, now: Instant, observations: Observations, scan: Scan) -> Estimate:
        """One step of the filter with what was seen, as it was seen."""
        points, times = observations.points, observations.times
        if running.settings.motion == "odometry" and scan.beam_times is not None and not self._velocity(scan):
            points, times = points.none(), None  # who knows how distorted they are
        if self._strayed:
            return self._made_sure(running, now, points)
        if times is not None:
            points = self._distortion.restore(points, times, scan.stamp)
        return running.step(points, now.stamp, now.odometry, Visibility(scan), times)

    def _made_sure(self, running: Filter, now: Instant, seen: Points) -> Estimate:
        """After a gap: predict, and look for the pose by several landmarks at once, near where it should be.

        One landmark alone may be taken for its neighbour.
        """
        predicted = running.step(seen.none(), now.stamp, now.odometry, None, None).unmoved(len(seen))
        try:
            pose, covariance = find(running, seen, near=(predicted.pose, predicted.covariance))
        except LostError:
            return predicted
        self._strayed = False
        return replace(predicted, pose=pose, covariance=covariance)

    def _judge(self, running: Filter) -> str | None:
        """Set the state after a step; what is to be said about it."""
        state = self._divergence.judge(self._estimate, running.is_at_odds)
        if state == "lost" and isinstance(running, Slam) and not is_recognisable(running):
            self._origin = MapOrigin(self._estimate.pose, self._origin.estimate(self._estimate).covariance)
            running.start_over(self._estimate.pose, ORIGIN)
            self._estimate = replace(self._estimate, covariance=ORIGIN)
            self._divergence.restart()
            self._state = "starting"
            return NEW_MAP
        if self._state == "starting" and not running.map.confirmed.any():
            return None
        self._state = state
        self._is_placed = state != "lost"
        return STATE_MESSAGES.get(state)

    def _coast(self) -> None:
        """After too many scans that were left out: who knows where the sensor goes meanwhile."""
        if self._filter is None or not self._is_placed or not self._continuity.is_broken:
            return
        drift = self._continuity.drift(self._filter.settings)
        self._filter.displace(np.zeros(3), drift)
        self._estimate = replace(self._estimate, covariance=self._estimate.covariance + drift)
        self._judge(self._filter)

    def _about_odometry(self, running: Filter, now: Instant) -> str | None:
        """What is to be said if there should be odometry."""
        expected = self.settings.motion == "odometry" or (
            self.settings.motion == "auto" and self._reckoning.pose is not None
        )
        missing = expected and now.odometry is None and running.settings.motion != "odometry"
        return NO_ODOMETRY if missing else None

    def _velocity(self, scan: Scan) -> Velocity | None:
        """The sensor's velocity: by odometry, if that moves the filter, else by the filter."""
        if self._estimate.velocity is None or (self._filter and self._filter.settings.motion == "odometry"):
            return self._reckoning.velocity(scan)
        v, w = self._estimate.velocity.tolist()
        return v, w, self._estimate.sideways

    def _set_start(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        self._start = start(as_pose(pose, "pose"), covariance, LocalizationSettings(), 3)
        self._estimate = Estimate(0.0, *self._start, None, no_innovation(0))
