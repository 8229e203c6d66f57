"""How the sensor moves: the unicycle, driven by odometry or by its own constant velocity [EKF 14-15, 22-26].

All predict a state whose first three entries are T_world_sensor, with its Jacobian and the noise of the step.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.errors import LocalizationError
from lidarcore.geometry import check_covariance
from lidarcore.localization.ekf.motion_kernels import (
    advance_at_constant_velocity,
    advance_by_odometry,
    advance_by_odometry_with_velocity,
    at_constant_velocity,
    by_odometry,
    by_odometry_with_velocity,
    glide,
)
from lidarcore.localization.motion_noise import OdometryNoise, VelocityNoise
from lidarcore.localization.settings import LocalizationSettings

_STANDING = np.zeros(3)


class Motion(Protocol):
    """Predicts a state (size,) over dt s; odometry says by which increment (3,), if there is any."""

    size: int

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """State (size,), Jacobian F and noise Q (size, size)."""

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """State (size,) after dt s, or before it, at the velocity in the state, and its Jacobian (size, size)."""

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """Predict a Gaussian in place: mean x (n,), covariance P (n, n), this state before the others."""


class OdometryMotion:
    """State (x, y, heading): moves by what odometry says, with noise that grows with the way, the turn and the time."""

    size = 3

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise.table

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move by the increment (3,) m, m, rad in the sensor frame; without one the sensor stands."""
        return by_odometry(state, dt, _STANDING if increment is None else increment, self._noise)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """Predict a Gaussian in place, as `predict` predicts the state."""
        advance_by_odometry(x, P, n, dt, _STANDING if increment is None else increment, self._noise)

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """Without a velocity the sensor stands."""
        return state, np.eye(3)


class OdometryWithVelocity:
    """State (x, y, heading, v, w, u): moves by what odometry says, and v, w, u are its increment over the time.

    An error of the increment is one of the pose and of the velocity by which a scan is deskewed, so that what is seen
    at a time of its own tells of both. Accelerations are those of the constant-velocity model.
    """

    size = 6

    def __init__(self, noise: OdometryNoise, accelerations: VelocityNoise) -> None:
        self._noise, self._rates = noise.table, _rates(accelerations)

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move by the increment (3,) m, m, rad in the sensor frame; without one the sensor stands."""
        moved = _STANDING if increment is None else increment
        return by_odometry_with_velocity(state, dt, moved, self._noise, self._rates)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """Predict a Gaussian in place, as `predict` predicts the state."""
        moved = _STANDING if increment is None else increment
        advance_by_odometry_with_velocity(x, P, n, dt, moved, self._noise, self._rates)

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """Move along the arc of v, w and u."""
        return glide(state, dt)


class ConstantVelocity:
    """State (x, y, heading, v, w, u): speeds ahead and to the left and the turn rate stay, but for white accelerations.

    [EKF 14-15] with u beside v: a sensor that is carried, or looks elsewhere than its wheels roll, is no unicycle.
    """

    size = 6

    def __init__(self, noise: VelocityNoise) -> None:
        self._rates = _rates(noise)

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move along the arc of v, w and u; odometry is not used."""
        return at_constant_velocity(state, dt, self._rates)

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """Move along the arc of v, w and u."""
        return glide(state, dt)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """Predict a Gaussian in place, as `predict` predicts the state."""
        advance_at_constant_velocity(x, P, n, dt, self._rates)


def _rates(noise: VelocityNoise) -> Array:
    """Variances (3,) by which v, w and u change in a second."""
    return np.square([noise.acceleration, noise.turn_acceleration, noise.sideways])


def motion_model(settings: LocalizationSettings, *, with_velocity: bool) -> Motion:
    """The model that the settings ask for; one with a velocity can deskew scans."""
    if settings.motion == "constant velocity":
        return ConstantVelocity(settings.velocity)
    if with_velocity:
        return OdometryWithVelocity(settings.odometry, settings.velocity)
    return OdometryMotion(settings.odometry)


def start(
    pose: Array, covariance: ArrayLike, settings: LocalizationSettings, size: int
) -> tuple[Array, Array]:
    """State (size,) and covariance at a pose (3,) with covariance (3, 3), standing as far as is known.

    Raises CovarianceError if the covariance is not positive definite, LocalizationError if it is not (3, 3).
    """
    P = np.array(covariance, np.float64)
    if P.shape != (3, 3):
        raise LocalizationError(
            f"The pose's covariance has shape {P.shape}: give that of x, y and heading, (3, 3)."
        )
    check_covariance(P, "The pose's covariance")
    if size == 3:
        return pose, P
    speed, turn_rate = settings.velocity.speed**2, settings.velocity.turn_rate**2
    full = np.diag([0.0, 0.0, 0.0, speed, turn_rate, speed if settings.velocity.sideways else 0.0])
    full[:3, :3] = P
    return np.concatenate([pose, np.zeros(3)]), full
