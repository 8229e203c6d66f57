"""How well the frame of a map that was begun anew is known in the world."""

from dataclasses import dataclass, field, replace

import numpy as np

from lidarcore.localization.estimate import Estimate
from lidarcore.localization.landmarks import Landmarks
from lidarcore.scan import Array


@dataclass(frozen=True, slots=True, eq=False)
class MapOrigin:
    """The pose (3,) at which a map was begun, with its covariance (3, 3) in the world.

    The filter knows what it sees from there; in the world all of it is as uncertain as its origin is besides.
    """

    pose: Array = field(default_factory=lambda: np.zeros(3))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def estimate(self, estimate: Estimate) -> Estimate:
        """The same in the world."""
        J = np.eye(3)
        J[:2, 2] = self._lever(estimate.pose[:2])
        return replace(estimate, covariance=estimate.covariance + J @ self.covariance @ J.T)

    def landmarks(self, landmarks: Landmarks) -> Landmarks:
        """The same in the world."""
        if not self.covariance.any():
            return landmarks
        points = landmarks.points
        J = np.tile(np.eye(2, 3), (len(points), 1, 1))
        J[:, :, 2] = self._lever(points.xy)
        covariance = points.covariance + J @ self.covariance @ J.transpose(0, 2, 1)
        return replace(landmarks, points=points.with_new(points.xy, covariance))

    def _lever(self, xy: Array) -> Array:
        """How points (..., 2) move as the frame turns about its origin."""
        x, y = np.moveaxis(xy - self.pose[:2], -1, 0)
        return np.stack([-y, x], -1)
