"""A known map that stays as it is, but for how often its landmarks are seen."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.localization.estimate import Estimate
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.localizer import Localizer
from lidarcore.localization.measurement import to_sensor
from lidarcore.localization.motion_kernels import move
from lidarcore.localization.points import Points
from lidarcore.localization.register import is_at_odds
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.localization.slam import Visible
from lidarcore.scan import Array


class KnownMap:
    """Localizes in the confirmed landmarks of a map, with the interface of Slam, and counts their sightings."""

    def __init__(
        self, settings: LocalizationSettings, pose: ArrayLike, covariance: ArrayLike, landmarks: Landmarks
    ) -> None:
        self.settings, self.is_at_odds = settings, False
        self.map = landmarks.subset(landmarks.confirmed)
        self._localizer = Localizer(self.map.points, pose, covariance, settings)
        self._pose, self._covariance = np.asarray(pose, np.float64), np.asarray(covariance, np.float64)
        self.restart_clock = self._localizer.restart_clock

    def reset(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """As Slam.reset."""
        self._localizer.reset(pose, covariance)
        self._pose, self._covariance = np.asarray(pose, np.float64), np.asarray(covariance, np.float64)

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None = None,
        visible: Visible | None = None,
        times: Array | None = None,
    ) -> Estimate:
        """As Slam.step; nothing is ever added to the map or dropped from it."""
        estimate = self._localizer.step(observed, stamp, odometry, times)
        self._pose, self._covariance = estimate.pose, estimate.covariance
        if visible is not None:
            z, _, _ = to_sensor(estimate.pose, self.map.points.xy)
            possible = min(int((visible(z).unseen > 0).sum()), len(observed))
            self.is_at_odds = is_at_odds(possible, len(estimate.association.landmark))
        seen = np.zeros(len(self.map), np.bool_)
        seen[estimate.association.landmark] = True
        self.map = replace(
            self.map,
            counts=self.map.counts + seen,
            first_seen=np.where(seen & (self.map.counts == 0), stamp, self.map.first_seen),
            last_seen=np.where(seen, stamp, self.map.last_seen),
        )
        return estimate

    def displace(self, increment: Array, covariance: Array) -> None:
        """As Slam.displace."""
        pose, F, G = move(self._pose, increment)
        self._pose, self._covariance = pose, F @ self._covariance @ F.T + G @ covariance @ G.T
        self.reset(self._pose, self._covariance)

    def drive_by(self, motion: Literal["odometry", "constant velocity"]) -> None:
        """As Slam.drive_by."""
        self._localizer.drive_by(motion)
        self.settings = self._localizer.settings
