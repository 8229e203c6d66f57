"""How the sensor moves: the unicycle, driven by odometry or by its own constant velocity [EKF 14-15, 22-26].

Both predict a state whose first three entries are T_world_sensor, with its Jacobian and the noise of the step.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.compiled import kernel
from lidarcore.errors import LocalizationError
from lidarcore.localization.kernels import odometry_variances, propagate, wrap
from lidarcore.localization.points import check_covariance
from lidarcore.localization.settings import LocalizationSettings, OdometryNoise, VelocityNoise
from lidarcore.scan import Array

_SERIES = 1e-3  # rad, below which the series of the arc is exact to rounding and its quotients are not
_NODES, _WEIGHTS = (
    0.5 + np.sqrt([0.15, 0, 0.15]) * [-1, 0, 1],
    np.array([5, 8, 5]) / 18,
)  # in [0, 1], three points
_STANDING = np.zeros(3)


@kernel
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


@kernel
def drift(velocity: Array, dt: float) -> tuple[Array, Array]:
    """Pose (3,) after dt s at speeds v ahead and u to the left, turn rate w, seen from the start; velocity (v, w, u).

    The arc of v, and that of u a quarter turn to the left of it; with its Jacobian (3, 3) by the velocity.
    """
    v, w, u = velocity[0], velocity[1], velocity[2]
    ahead, J = arc(v, w, dt)
    left, K = arc(u, w, dt)
    J_drift = np.array(
        [
            [J[0, 0], J[0, 1] - K[1, 1], -K[1, 0]],
            [J[1, 0], J[1, 1] + K[0, 1], K[0, 0]],
            [0.0, dt, 0.0],
        ]
    )
    return np.array([ahead[0] - left[1], ahead[1] + left[0], ahead[2]]), J_drift


@kernel
def move(pose: Array, increment: Array) -> tuple[Array, Array, Array]:
    """T_world_sensor (3,) after an increment (3,) seen from it; Jacobians (3, 3) by pose and by increment [EKF 24]."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    moved, F, G = np.empty(3), np.eye(3), np.eye(3)
    G[0, 0], G[0, 1], G[1, 0], G[1, 1] = c, -s, s, c
    F[0, 2], F[1, 2] = -s * increment[0] - c * increment[1], c * increment[0] - s * increment[1]
    moved[0], moved[1], moved[2] = pose[0] + F[1, 2], pose[1] - F[0, 2], wrap(pose[2] + increment[2])
    return moved, F, G


@kernel
def _by_odometry(pose: Array, dt: float, increment: Array, noise: Array) -> tuple[Array, Array, Array]:
    """State, Jacobian and noise of an increment over dt s with the noise of OdometryNoise, as its table (7,)."""
    moved, F, G = move(pose, increment)
    ahead, across, turn = odometry_variances(increment, dt, noise)
    c, s, Q = G[0, 0], G[1, 0], np.zeros((3, 3))
    Q[0, 0], Q[1, 1], Q[2, 2] = c * c * ahead + s * s * across, s * s * ahead + c * c * across, turn
    Q[0, 1] = Q[1, 0] = c * s * (ahead - across)
    return moved, F, Q


@kernel
def _by_odometry_with_velocity(
    state: Array, dt: float, increment: Array, noise: Array, rates: Array
) -> tuple[Array, Array, Array]:
    """State (6,), Jacobian and noise: the velocity is that of the increment, and so are its errors, over dt."""
    pose, F_pose, Q_pose = _by_odometry(state[:3], dt, increment, noise)
    moved, F, Q = np.concatenate((pose, state[3:])), np.eye(6), np.zeros((6, 6))
    F[:3, :3], Q[:3, :3] = F_pose, Q_pose
    if dt <= 0.0:
        return moved, F, Q
    variances = odometry_variances(increment, dt, noise)
    c, s = np.cos(state[2]), np.sin(state[2])
    for axis, row in ((0, 3), (1, 5), (2, 4)):  # ahead, sideways, turn
        moved[row], F[row, row] = increment[axis] / dt, 0.0
        Q[row, row] = variances[axis] / dt**2 + rates[row - 3] * dt
    Q[0, 3], Q[1, 3], Q[2, 4] = c * variances[0] / dt, s * variances[0] / dt, variances[2] / dt
    Q[0, 5], Q[1, 5] = -s * variances[1] / dt, c * variances[1] / dt
    for i in range(3):
        for j in range(3, 6):
            Q[j, i] = Q[i, j]
    return moved, F, Q


@kernel
def _glide(state: Array, dt: float) -> tuple[Array, Array]:
    """State (6,) after dt s at the velocity it has, and its Jacobian (6, 6)."""
    step, J = drift(state[3:], dt)
    pose, F_pose, G = move(state[:3], step)
    F = np.eye(6)
    for i in range(3):
        for j in range(3):
            F[i, j] = F_pose[i, j]
            F[i, 3 + j] = G[i, 0] * J[0, j] + G[i, 1] * J[1, j] + G[i, 2] * J[2, j]
    return np.concatenate((pose, state[3:])), F


@kernel
def _at_constant_velocity(state: Array, dt: float, rates: Array) -> tuple[Array, Array, Array]:
    """State, Jacobian and noise after dt s in which the velocity changes as white noise of these rates (3,), squared.

    The noise is the sum of what accelerations at each moment do to the end of the step, by Gauss-Legendre quadrature.
    """
    end, F = _glide(state, dt)
    Q, effect = np.zeros((6, 6)), np.eye(6)[:, 3:]
    for node in range(len(_NODES)):
        left = dt * _NODES[node]
        J, turned = drift(state[3:], left)[1], state[2] + state[4] * (dt - left)
        c, s = np.cos(turned), np.sin(turned)
        for k in range(3):
            effect[0, k] = c * J[0, k] - s * J[1, k]
            effect[1, k] = s * J[0, k] + c * J[1, k]
            effect[2, k] = J[2, k]
        for i in range(6):
            for j in range(6):
                for k in range(3):
                    Q[i, j] += _WEIGHTS[node] * dt * effect[i, k] * rates[k] * effect[j, k]
    return end, F, Q


@kernel
def _advance_by_odometry(x: Array, P: Array, n: int, dt: float, increment: Array, noise: Array) -> None:
    state, F, Q = _by_odometry(x, dt, increment, noise)
    propagate(x, P, n, state, F, Q)


@kernel
def _advance_by_odometry_with_velocity(
    x: Array, P: Array, n: int, dt: float, increment: Array, noise: Array, rates: Array
) -> None:
    state, F, Q = _by_odometry_with_velocity(x[:6], dt, increment, noise, rates)
    propagate(x, P, n, state, F, Q)


@kernel
def _advance_at_constant_velocity(x: Array, P: Array, n: int, dt: float, rates: Array) -> None:
    state, F, Q = _at_constant_velocity(x[:6], dt, rates)
    propagate(x, P, n, state, F, Q)


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
        return _by_odometry(state, dt, _STANDING if increment is None else increment, self._noise)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """The same as predict, in place."""
        _advance_by_odometry(x, P, n, dt, _STANDING if increment is None else increment, self._noise)

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
        return _by_odometry_with_velocity(state, dt, moved, self._noise, self._rates)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """The same as predict, in place."""
        moved = _STANDING if increment is None else increment
        _advance_by_odometry_with_velocity(x, P, n, dt, moved, self._noise, self._rates)

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """Move along the arc of v, w and u."""
        return _glide(state, dt)


class ConstantVelocity:
    """State (x, y, heading, v, w, u): speeds ahead and to the left and the turn rate stay, but for white accelerations.

    [EKF 14-15] with u beside v: a sensor that is carried, or looks elsewhere than its wheels roll, is no unicycle.
    """

    size = 6

    def __init__(self, noise: VelocityNoise) -> None:
        self._rates = _rates(noise)

    def predict(self, state: Array, dt: float, increment: Array | None) -> tuple[Array, Array, Array]:
        """Move along the arc of v, w and u; odometry is not used."""
        return _at_constant_velocity(state, dt, self._rates)

    def glide(self, state: Array, dt: float) -> tuple[Array, Array]:
        """Move along the arc of v, w and u."""
        return _glide(state, dt)

    def advance(self, x: Array, P: Array, n: int, dt: float, increment: Array | None) -> None:
        """The same as predict, in place."""
        _advance_at_constant_velocity(x, P, n, dt, self._rates)


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
