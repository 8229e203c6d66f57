"""Where the sensor has been: estimated, by odometry alone, and true, where that is known."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from lidarcore import Array
from lidarcore.geometry import compose, inverse
from lidarcore.localization import TrackingResult

STEP = 0.03  # m between the points of a trail
MOST = 4000  # points of a trail; when there are more, every second one goes
KEPT = 100_000  # poses of the trajectory: nearly three hours at 10 Hz


@dataclass(frozen=True, slots=True)
class TrackedPose:
    """T_world_sensor as it was estimated at a stamp, s: m, m, rad, their standard deviations and covariances."""

    stamp: float
    x: float
    y: float
    heading: float
    sigma_x: float
    sigma_y: float
    sigma_heading: float
    cov_xy: float
    cov_x_heading: float
    cov_y_heading: float


class Trail:
    """Points at least STEP apart, and not too many: of a long way they are farther apart, as far everywhere."""

    def __init__(self) -> None:
        self.points: Array = np.empty((0, 2))
        self._step = STEP

    def add(self, xy: Array) -> None:
        """Go on to a point (2,) m; a step too small to see adds none."""
        if not np.isfinite(xy).all():
            return
        if len(self.points) and np.hypot(*(xy - self.points[-1])) < self._step:
            return
        if len(self.points) >= MOST:
            self.points, self._step = self.points[::2], 2 * self._step
        self.points = np.vstack([self.points, xy])


def thinned(points: Array) -> Array:
    """At most MOST of points (N, 2) and the last one, as far apart everywhere: what is drawn is sent with each scan."""
    return np.vstack([points[: -1 : 1 + len(points) // MOST], points[-1:]])


@dataclass(frozen=True, slots=True)
class Paths:
    """Trails (T, 2) m, world frame, of one moment; the arrays never change."""

    estimated: Array
    dead_reckoned: Array
    true: Array


NO_PATHS = Paths(*(np.empty((0, 2)) for _ in range(3)))


class Trails:
    """The ways of one run, and its trajectory.

    A map that SLAM built has a frame of its own, and so has the truth of a recording: there the truth is placed by
    where the sensor is seen first.
    """

    def __init__(self, own_frame: bool) -> None:
        self._own_frame = own_frame
        self.trajectory: deque[TrackedPose] = deque(maxlen=KEPT)
        self._estimated, self._dead_reckoned, self._true = Trail(), Trail(), Trail()
        self._T_world_truth: Array | None = None

    def add(self, tracking: TrackingResult, truth: Array | None) -> Array | None:
        """Go on; the truth (3,) in the frame of the run, if there is any."""
        if tracking.mode == "localize" and tracking.state == "starting":
            return None  # nothing is known of the pose yet
        estimate = tracking.estimate
        C = estimate.covariance
        errors = [*np.sqrt(np.diag(C)).tolist(), *C[np.triu_indices(3, 1)].tolist()]
        self.trajectory.append(TrackedPose(tracking.stamp, *estimate.pose.tolist(), *errors))
        self._estimated.add(estimate.pose[:2])
        if tracking.dead_reckoned is not None:
            self._dead_reckoned.add(tracking.dead_reckoned[:2])
        if truth is None:
            return None
        in_world = self._placed(truth, tracking)
        self._true.add(in_world[:2])
        return in_world

    def paths(self) -> Paths:
        """The trails as they are now."""
        return Paths(self._estimated.points, self._dead_reckoned.points, self._true.points)

    def _placed(self, truth: Array, tracking: TrackingResult) -> Array:
        if self._T_world_truth is None:
            shift = self._own_frame and bool(np.isfinite(truth).all())
            start = tracking.estimate.pose
            self._T_world_truth = compose(start, inverse(truth)) if shift else np.zeros(3)
        return compose(self._T_world_truth, truth)
