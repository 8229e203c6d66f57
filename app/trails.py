"""Where the sensor has been: estimated, by odometry alone, and in truth."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from lidarcore.localization import Whereabouts
from lidarcore.poses import compose, inverse
from lidarcore.scan import Array

STEP = 0.03  # m between the points of a trail
MOST = 4000  # points of a trail; when there are more, every second one goes
KEPT = 100_000  # poses of the trajectory: nearly three hours at 10 Hz

Row = tuple[float, float, float, float, float, float, float]


class Trail:
    """Points at least STEP apart, and not too many."""

    def __init__(self) -> None:
        self.points: Array = np.empty((0, 2))

    def add(self, xy: Array) -> None:
        """Go on to a point (2,) m; a step too small to see adds none."""
        if not np.isfinite(xy).all():
            return
        if len(self.points) and np.hypot(*(xy - self.points[-1])) < STEP:
            return
        kept = self.points if len(self.points) < MOST else self.points[::2]
        self.points = np.vstack([kept, xy])


@dataclass(frozen=True, slots=True)
class Paths:
    """Trails (T, 2) m, world frame, of one moment; the arrays never change."""

    estimated: Array
    dead_reckoned: Array
    true: Array


NO_PATHS = Paths(*(np.empty((0, 2)) for _ in range(3)))


class Trails:
    """The ways of one run, and its trajectory.

    A map that SLAM built has a frame of its own, in which the truth is placed by where the sensor is seen first.
    """

    def __init__(self, own_frame: bool) -> None:
        self._own_frame = own_frame
        self.trajectory: deque[Row] = deque(maxlen=KEPT)
        self._estimated, self._dead_reckoned, self._true = Trail(), Trail(), Trail()
        self._T_world_truth: Array | None = None

    def add(self, whereabouts: Whereabouts, truth: Array | None) -> Array | None:
        """Go on; the truth (3,) in the frame of the run, if there is any."""
        if whereabouts.mode == "localize" and whereabouts.state == "starting":
            return None  # nothing is known of the pose yet
        estimate = whereabouts.estimate
        sigma = np.sqrt(np.diag(estimate.covariance))
        self.trajectory.append((whereabouts.stamp, *estimate.pose.tolist(), *sigma.tolist()))
        self._estimated.add(estimate.pose[:2])
        if whereabouts.dead_reckoned is not None:
            self._dead_reckoned.add(whereabouts.dead_reckoned[:2])
        if truth is None:
            return None
        in_world = self._placed(truth, whereabouts)
        self._true.add(in_world[:2])
        return in_world

    def paths(self) -> Paths:
        """The trails as they are now."""
        return Paths(self._estimated.points, self._dead_reckoned.points, self._true.points)

    def _placed(self, truth: Array, whereabouts: Whereabouts) -> Array:
        if self._T_world_truth is None:
            shift = self._own_frame and bool(np.isfinite(truth).all())
            start = whereabouts.estimate.pose
            self._T_world_truth = compose(start, inverse(truth)) if shift else np.zeros(3)
        return compose(self._T_world_truth, truth)
