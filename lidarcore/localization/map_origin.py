"""How well the frame of a map that was started during a run is known in the world."""

from dataclasses import dataclass, field, replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import act_inverse, act_jacobians
from lidarcore.localization.ekf.estimate import Estimate
from lidarcore.localization.landmarks import Landmarks


@dataclass(frozen=True, slots=True, eq=False)
class MapOrigin:
    """The pose (3,) at which a map was started, with its covariance (3, 3) in the world.

    The filter knows what it sees from there; in the world all of it is as uncertain as its origin is besides.
    """

    pose: Array = field(default_factory=lambda: np.zeros(3))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def estimate(self, estimate: Estimate) -> Estimate:
        """An estimate in the map, with its covariance in the world."""
        J = np.eye(3)
        J[:2] = self._jacobian(estimate.pose[:2])
        return replace(estimate, covariance=estimate.covariance + J @ self.covariance @ J.T)

    def landmarks(self, landmarks: Landmarks) -> Landmarks:
        """Landmarks of the map, with their covariances in the world."""
        if not self.covariance.any():
            return landmarks
        points = landmarks.points
        J = self._jacobian(points.xy)
        covariance = points.covariance + J @ self.covariance @ J.transpose(0, 2, 1)
        return replace(landmarks, points=points.with_new(points.xy, covariance))

    def _jacobian(self, xy: Array) -> Array:
        """How points (..., 2) move with the frame in which they are fixed, (..., 2, 3)."""
        return act_jacobians(self.pose, act_inverse(self.pose, xy))[0]
