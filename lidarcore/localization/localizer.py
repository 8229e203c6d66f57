"""Localization in a known map: the extended Kalman filter on one screen [EKF 14-26]."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.localization.association import match
from lidarcore.localization.estimate import Estimate, Instant, as_pose
from lidarcore.localization.kalman import Innovation, block_diagonal, correction
from lidarcore.localization.measurement import to_sensor
from lidarcore.localization.motion import motion_model, start
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.scan import Array


class Localizer:
    """Tracks T_world_sensor from point landmarks of a known map.

    landmarks   the map, world frame; its covariances are taken as independent of the pose
    pose        (3,) m, m, rad where the sensor starts, with its covariance (3, 3)

    After an error the filter is as before the call. Raises LocalizationError for numbers that are not finite,
    CovarianceError for a covariance that is not positive definite.
    """

    def __init__(
        self,
        landmarks: Points,
        pose: ArrayLike,
        covariance: ArrayLike,
        settings: LocalizationSettings | None = None,
    ) -> None:
        self.landmarks = landmarks
        self.settings = settings or LocalizationSettings()
        self._motion = motion_model(self.settings)
        self._last: Instant | None = None
        self.reset(pose, covariance)

    def reset(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Start again from a pose (3,) and its covariance (3, 3), as from a relocalization."""
        self._state, self._P = start(as_pose(pose, "pose"), covariance, self.settings)

    def restart_clock(self) -> None:
        """Take the next stamp and odometry as they come, after a clock or an encoder was reset."""
        self._last = None

    def step(self, observed: Points, stamp: float, odometry: ArrayLike | None = None) -> Estimate:
        """Predict to the stamp (s), match the points seen (sensor frame), correct; odometry is T_odom_sensor (3,).

        Without a match the filter coasts: the estimate says so, and the pose is the predicted one.
        Raises MotionError if the clock went back, or odometry is missing or jumped.
        """
        now = Instant(stamp, None if odometry is None else np.asarray(odometry, np.float64))
        state, P = self._predicted(now)
        innovation, H = self._innovation(observed, state, P)
        PHt = P[:, :3] @ H.T
        change, W = correction(PHt, innovation)
        state, P = state + change, P - W @ W.T
        state[:3] = as_pose(state[:3], "the corrected pose")
        self._state, self._P, self._last = state, P, now
        return Estimate(
            stamp,
            state[:3].copy(),
            P[:3, :3].copy(),
            state[3:].copy() if len(state) > 3 else None,
            innovation,
        )

    def _predicted(self, now: Instant) -> tuple[Array, Array]:
        if self._last is None:
            return self._state, self._P
        state, F, Q = self._motion.predict(self._state, *self._last.until(now, self.settings))
        return state, F @ self._P @ F.T + Q

    def _innovation(self, observed: Points, state: Array, P: Array) -> tuple[Innovation, Array]:
        """Innovation of the compatible pairs, and their Jacobian by the pose (2 P, 3)."""
        z, H, R_sensor_world = to_sensor(state[:3], self.landmarks.xy)
        M = R_sensor_world @ self.landmarks.covariance @ R_sensor_world.T
        association = match(
            observed, z, H @ P[:3, :3] @ H.transpose(0, 2, 1) + M, self.landmarks.kinds, self.settings
        )
        i, j = association.observed, association.landmark
        H_pairs = H[j].reshape(-1, 3)
        S = H_pairs @ P[:3, :3] @ H_pairs.T + block_diagonal(M[j] + observed.covariance[i])
        innovation, kept = Innovation(association, observed.xy[i] - z[j], S).compatible(self.settings.gate)
        return innovation, H[j][kept].reshape(-1, 3)
