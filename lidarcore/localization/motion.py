"""How the sensor moves: the unicycle, driven by odometry or by its own constant velocity [EKF 14-15, 22-26].

Both predict a state whose first three entries are T_world_sensor, with its Jacobian and the noise of the step.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.errors import LocalizationError
from lidarcore.localization.measurement import rotation
from lidarcore.localization.points import check_covariance
from lidarcore.localization.settings import LocalizationSettings, OdometryNoise, VelocityNoise
from lidarcore.poses import wrap
from lidarcore.scan import Array

_SERIES = 1e-3  # rad, below which the series of the arc is exact to rounding and its quotients are not
_NODES, _WEIGHTS = (
    0.5 + np.sqrt([0.15, 0, 0.15]) * [-1, 0, 1],
    np.array([5, 8, 5]) / 18,
)  # in [0, 1], three points


def arc(v: float, w: float, dt: float) -> tuple[Array, Array]:
    """Pose (3,) after dt s at speed v m/s and turn rate w rad/s, seen from the start; its Jacobian (3, 2) by (v, w).

    The exact arc, of which [EKF 22] is the first term.
    """
    a = w * dt
    if abs(a) < _SERIES:
        A, B = 1 - a**2 / 6, a / 2 - a**3 / 24
        dA, dB = -a / 3 + a**3 / 30, 0.5 - a**2 / 8
    else:
        A, B = np.sin(a) / a, (1 - np.cos(a)) / a
        dA, dB = (np.cos(a) - A) / a, (np.sin(a) - B) / a
    step = v * dt
    return np.array([A * step, B * step, a]), np.array(
        [[A * dt, step * dA * dt], [B * dt, step * dB * dt], [0.0, dt]]
    )


def move(pose: Array, increment: Array) -> tuple[Array, Array, Array]:
    """T_world_sensor (3,) after an increment (3,) seen from it; Jacobians (3, 3) by pose and by increment [EKF 24]."""
    R = rotation(pose[2])
    dx, dy = R @ increment[:2]
    F, G = np.eye(3), np.eye(3)
    F[0, 2], F[1, 2] = -dy, dx
    G[:2, :2] = R
    return np.array([pose[0] + dx, pose[1] + dy, wrap(pose[2] + increment[2])]), F, G


class Motion(Protocol):
    """Predicts a state (size,) over dt s; odometry says by which increment (3,), if there is any."""

    size: int

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """State (size,), Jacobian F and noise Q (size, size)."""


class OdometryMotion:
    """State (x, y, heading): moves by what odometry says, with noise that grows with the way and the turn."""

    size = 3

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move by the increment (3,) m, m, rad in the sensor frame; without one the sensor stands."""
        u = np.zeros(3) if increment is None else increment
        state, F, G = move(state, u)
        return state, F, G @ self._noise.covariance(u) @ G.T


class ConstantVelocity:
    """State (x, y, heading, v, w): v and w keep their values but for white accelerations [EKF 14-15]."""

    size = 5

    def __init__(self, noise: VelocityNoise) -> None:
        self._noise = noise

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move along the arc of v and w; odometry is not used."""
        step, J = arc(state[3], state[4], dt)
        pose, F_pose, G = move(state[:3], step)
        F = np.eye(5)
        F[:3, :3], F[:3, 3:] = F_pose, G @ J
        return np.concatenate([pose, state[3:]]), F, self._process_noise(state, dt)

    def _process_noise(self, state: Array, dt: float) -> Array:
        """Sum of what accelerations at each moment do to the end of the step, by Gauss-Legendre quadrature."""
        rates = [self._noise.acceleration**2, self._noise.turn_acceleration**2]
        Q = np.zeros((5, 5))
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            left = dt * node
            effect = np.eye(5)[:, 3:]
            effect[:3] = arc(state[3], state[4], left)[1]
            effect[:2] = rotation(state[2] + state[4] * (dt - left)) @ effect[:2]
            Q += weight * dt * (effect * rates) @ effect.T
        return Q


def motion_model(settings: LocalizationSettings) -> Motion:
    """The model that the settings ask for."""
    if settings.motion == "odometry":
        return OdometryMotion(settings.odometry)
    return ConstantVelocity(settings.velocity)


def start(pose: Array, covariance: ArrayLike, settings: LocalizationSettings) -> tuple[Array, Array]:
    """State and covariance of the motion model at a pose (3,) with covariance (3, 3), standing as far as is known.

    Raises CovarianceError if the covariance is not positive definite, LocalizationError if it is not (3, 3).
    """
    P = np.array(covariance, np.float64)
    if P.shape != (3, 3):
        raise LocalizationError(
            f"The pose's covariance has shape {P.shape}: give that of x, y and heading, (3, 3)."
        )
    check_covariance(P, "The pose's covariance")
    if settings.motion == "odometry":
        return pose, P
    full = np.diag([0.0, 0.0, 0.0, settings.velocity.speed**2, settings.velocity.turn_rate**2])
    full[:3, :3] = P
    return np.concatenate([pose, np.zeros(2)]), full
