"""Simultaneous localization and mapping: pose and landmarks in one extended Kalman filter [EKF 14-26]."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarcore.localization.association import Association, match
from lidarcore.localization.estimate import Estimate, Instant, as_pose
from lidarcore.localization.joint import JointState
from lidarcore.localization.kalman import Innovation
from lidarcore.localization.motion import motion_model, start
from lidarcore.localization.points import Points
from lidarcore.localization.register import Register
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.scan import Array

Visible = Callable[[Array], NDArray[np.bool_]]
"""Which of the points (L, 2) m, sensor frame, would have been seen if they were there: (L,)."""

_ORIGIN = 1e-6 * np.eye(3)


class Slam:
    """Tracks T_world_sensor and builds the map of the landmarks it sees.

    pose (3,) m, m, rad and covariance (3, 3) say where the world frame is: by default the sensor starts at its
    origin, known to a millimetre and a milliradian. A landmark is tentative until seen often enough, and dropped
    when views of its place without it outweigh the sightings. After an error the filter is as before the call.
    """

    def __init__(
        self,
        settings: LocalizationSettings | None = None,
        pose: ArrayLike = (0.0, 0.0, 0.0),
        covariance: ArrayLike | None = None,
    ) -> None:
        self.settings = settings or LocalizationSettings()
        self._motion = motion_model(self.settings)
        self._joint = JointState(
            *start(as_pose(pose, "pose"), _ORIGIN if covariance is None else covariance, self.settings)
        )
        self._register = Register(self.settings)
        self._last: Instant | None = None

    @property
    def landmarks(self) -> Points:
        """All landmarks in the world frame, tentative ones too, in the order of `ids` and `confirmed`."""
        return Points(self._joint.landmarks, self._joint.landmark_covariances, self._register.kinds)

    @property
    def ids(self) -> NDArray[np.int64]:
        """(L,) a number for each landmark that is never given again."""
        return self._register.ids.copy()

    @property
    def confirmed(self) -> NDArray[np.bool_]:
        """(L,) true for landmarks that were seen often enough."""
        return self._register.confirmed

    def restart_clock(self) -> None:
        """Take the next stamp and odometry as they come, after a clock or an encoder was reset."""
        self._last = None

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None = None,
        visible: Visible | None = None,
    ) -> Estimate:
        """Predict to the stamp (s), match the points seen (sensor frame), correct, and keep the map.

        odometry is T_odom_sensor (3,); visible tells which landmarks should be seen, without it none is dropped.
        The association's landmarks are indices into the map before this step.
        Raises MotionError if the clock went back, or odometry is missing or jumped.
        """
        now = Instant(stamp, None if odometry is None else np.asarray(odometry, np.float64))
        moved = None if self._last is None else self._last.until(now, self.settings)
        joint, self._last = self._joint, now
        if moved is not None:
            joint.predict(*self._motion.predict(joint.state, *moved))
        innovation = self._correct(observed)
        self._keep_map(observed, innovation.association, visible)
        state, P = joint.state.copy(), joint.state_covariance[:3, :3].copy()
        return Estimate(stamp, state[:3], P, state[3:] if len(state) > 3 else None, innovation)

    def _correct(self, observed: Points) -> Innovation:
        z, S = self._joint.expected()
        association = match(observed, z, S, self._register.kinds, self.settings)
        i, j = association.observed, association.landmark
        PHt, S_pairs = self._joint.gains(j, observed.covariance[i])
        innovation, kept = Innovation(association, observed.xy[i] - z[j], S_pairs).compatible(
            self.settings.gate
        )
        self._joint.correct(PHt[:, (2 * kept[:, None] + [0, 1]).ravel()], innovation)
        return innovation

    def _keep_map(self, observed: Points, association: Association, visible: Visible | None) -> None:
        """Count sightings and misses, drop what is not there, add what is new."""
        if visible is not None:
            should_be_seen = visible(self._joint.expected()[0])
            kept = self._register.count(association, should_be_seen)
            if not kept.all():
                self._joint.keep(kept)
        else:
            self._register.count(association, np.zeros(len(self._joint), np.bool_))
        new = association.new
        if len(new):
            self._joint.add(observed.xy[new], observed.covariance[new])
            self._register.add(np.asarray(observed.kinds)[new])
