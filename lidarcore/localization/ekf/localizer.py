"""Localization in a known map of point landmarks by an extended Kalman filter [EKF 14-21]."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, act_inverse, chi_square_gate, rotation
from lidarcore.localization.coincidence import densities, evidence
from lidarcore.localization.ekf import motion_kernels, sighting_kernels
from lidarcore.localization.ekf.association import match
from lidarcore.localization.ekf.estimate import Estimate, Innovation, Instant, as_pose
from lidarcore.localization.ekf.motion import motion_model, start
from lidarcore.localization.ekf.register import is_at_odds
from lidarcore.localization.ekf.slam import Visible
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.observations import in_moments, joined
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings


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
        self._density = densities(landmarks.xy, landmarks.kinds, np.arange(len(landmarks)))
        self.settings = settings or LocalizationSettings()
        self._motion = motion_model(self.settings, with_velocity=False)
        self._last: Instant | None = None
        self.reset(pose, covariance)

    def reset(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Start again from a pose (3,) and its covariance (3, 3), as from a relocation."""
        self._state, self._P = start(as_pose(pose, "pose"), covariance, self.settings, self._motion.size)

    def drive_by(self, motion: Literal["odometry", "constant velocity"]) -> None:
        """Predict by this from now on, with the pose as it is."""
        self.settings = replace(self.settings, motion=motion)
        self._motion = motion_model(self.settings, with_velocity=False)
        self.reset(self._state[:3], self._P[:3, :3])

    def displace(self, increment: Array, covariance: Array) -> None:
        """Move by an increment (3,) seen from the sensor, with its covariance (3, 3), which leaves no velocity."""
        here = UncertainPose(self._state[:3], self._P[:3, :3])
        self.reset(*here.compose(UncertainPose(increment, covariance)))

    def restart_clock(self) -> None:
        """Take the next stamp and odometry as they come, after a clock or an encoder was reset."""
        self._last = None

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None = None,
        times: Array | None = None,
    ) -> Estimate:
        """Predict to the stamp (s), match the points seen (sensor frame), correct; odometry is T_odom_sensor (3,).

        times (K,) s after the stamp say when each point was seen from where the sensor was then; only a filter with
        a velocity can use them. Without a match the filter coasts: the estimate says so, and the pose is predicted.
        Raises MotionError if the clock went back, or odometry is missing or jumped.
        """
        now = Instant(stamp, None if odometry is None else np.asarray(odometry, np.float64))
        x, P = self._state.copy(), self._P.copy()
        if self._last is not None:
            self._motion.advance(x, P, len(x), *self._last.until(now, self.settings))
        parts = []
        for time, seen in in_moments(times, len(observed)):
            self._shift(x, P, time)
            parts.append((seen, self._correct(x, P, observed.subset(seen))))
            self._shift(x, P, -time)
        x[:3] = as_pose(x[:3], "the corrected pose")
        self._state, self._P, self._last = x, P, now
        return Estimate.of(stamp, x, P, joined(parts))

    def _shift(self, x: Array, P: Array, time: float) -> None:
        """Go so many seconds on at the velocity of the state: a change of variables that can be undone."""
        if time != 0:
            state, F = self._motion.glide(x, time)
            motion_kernels.propagate(x, P, len(x), state, F, np.zeros_like(F))

    def _correct(self, x: Array, P: Array, observed: Points) -> Innovation:
        """Correct by the compatible pairs, and tell them."""
        known, independent = self.landmarks, np.zeros((len(self.landmarks), 3, 2))
        z, S = sighting_kernels.expect(x, P, known.xy, independent, known.covariance)
        far = chi_square_gate(self.settings.new_gate)
        near = sighting_kernels.within_any(
            sighting_kernels.all_squared_distances(observed.xy, observed.covariance, z, S), far
        )
        association = match(observed, z[near], S[near], np.asarray(known.kinds)[near], self.settings).of(near)
        i, j = association.observed, association.landmark
        R_world_sensor, given = rotation(x[2]), np.full(len(j), -1)
        noise = observed.covariance[i] + R_world_sensor.T @ known.covariance[j] @ R_world_sensor
        S_pairs = sighting_kernels.innovation_covariance(x, P, z[j], noise, given)
        innovation, kept = Innovation(association, observed.xy[i] - z[j], S_pairs).compatible(
            self.settings.gate
        )
        told = evidence(innovation.value, innovation.covariance, self._density[j[kept]])
        if told < np.log(self.settings.ambiguity):
            return innovation.doubted()
        sighting_kernels.correct(x, P, len(x), z[j[kept]], innovation.value, noise[kept], given[kept])
        return innovation


class KnownMap:
    """Localizes in the confirmed landmarks of a map, with the interface of Slam, and counts their sightings."""

    def __init__(
        self, settings: LocalizationSettings, pose: ArrayLike, covariance: ArrayLike, landmarks: Landmarks
    ) -> None:
        self.settings, self.is_at_odds = settings, False
        self.map = landmarks.subset(landmarks.confirmed)
        self._localizer = Localizer(self.map.points, pose, covariance, settings)
        self.reset, self.displace = self._localizer.reset, self._localizer.displace
        self.restart_clock = self._localizer.restart_clock

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None = None,
        visible: Visible | None = None,
        times: Array | None = None,
    ) -> Estimate:
        """One scan, as in `Slam.step`; nothing is ever added to the map or dropped from it."""
        estimate = self._localizer.step(observed, stamp, odometry, times)
        if visible is not None:
            z = act_inverse(estimate.pose, self.map.points.xy)
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

    def drive_by(self, motion: Literal["odometry", "constant velocity"]) -> None:
        """Predict by this from now on, as `Slam.drive_by` does."""
        self._localizer.drive_by(motion)
        self.settings = self._localizer.settings
