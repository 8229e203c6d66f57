"""Steps of the unicycle, compiled: along an arc, by odometry, at constant velocity [EKF 14-15, 22-26].

States begin with T_world_sensor; a step gives the next state, its Jacobian and the noise it adds.
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry.kernels import compose_with_jacobians, rotate, rotated_covariance

_SERIES = 1e-3  # rad, below which the series of the arc is exact to rounding and its quotients are not
_NODES, _WEIGHTS = (
    0.5 + np.sqrt([0.15, 0, 0.15]) * [-1, 0, 1],
    np.array([5, 8, 5]) / 18,
)  # in [0, 1], three points


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
def odometry_variances(increment: Array, dt: float, noise: Array) -> tuple[float, float, float]:
    """Variances of an increment (3,) m, m, rad over dt s, in the sensor frame before it, from OdometryNoise.table."""
    way, turn = np.hypot(increment[0], increment[1]), np.abs(increment[2])
    slip = noise[4] ** 2 * turn + noise[5] ** 2 * dt
    heading = noise[2] ** 2 * way + noise[3] ** 2 * turn + noise[6] ** 2 * dt
    return noise[0] ** 2 * way + slip, noise[1] ** 2 * way + slip, heading


@kernel
def by_odometry(pose: Array, dt: float, increment: Array, noise: Array) -> tuple[Array, Array, Array]:
    """State, Jacobian and noise of an increment over dt s with the noise of OdometryNoise, as its table (7,)."""
    moved, F, G = compose_with_jacobians(pose, increment)
    ahead, across, turn = odometry_variances(increment, dt, noise)
    c, s, Q = G[0, 0], G[1, 0], np.zeros((3, 3))
    Q[0, 0], Q[0, 1], Q[1, 1] = rotated_covariance(c, s, ahead, 0.0, across)
    Q[1, 0], Q[2, 2] = Q[0, 1], turn
    return moved, F, Q


@kernel
def by_odometry_with_velocity(
    state: Array, dt: float, increment: Array, noise: Array, rates: Array
) -> tuple[Array, Array, Array]:
    """State (6,), Jacobian and noise: the velocity is that of the increment, and so are its errors, over dt."""
    pose, F_pose, Q_pose = by_odometry(state[:3], dt, increment, noise)
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
def glide(state: Array, dt: float) -> tuple[Array, Array]:
    """State (6,) after dt s at the velocity it has, and its Jacobian (6, 6)."""
    step, J = drift(state[3:], dt)
    pose, F_pose, G = compose_with_jacobians(state[:3], step)
    F = np.eye(6)
    for i in range(3):
        for j in range(3):
            F[i, j] = F_pose[i, j]
            F[i, 3 + j] = G[i, 0] * J[0, j] + G[i, 1] * J[1, j] + G[i, 2] * J[2, j]
    return np.concatenate((pose, state[3:])), F


@kernel
def at_constant_velocity(state: Array, dt: float, rates: Array) -> tuple[Array, Array, Array]:
    """State, Jacobian and noise after dt s in which the velocity changes as white noise of these rates (3,), squared.

    The noise is the sum of what accelerations at each moment do to the end of the step, by Gauss-Legendre quadrature.
    """
    end, F = glide(state, dt)
    Q, effect = np.zeros((6, 6)), np.eye(6)[:, 3:]
    for node in range(len(_NODES)):
        left = dt * _NODES[node]
        J, turned = drift(state[3:], left)[1], state[2] + state[4] * (dt - left)
        c, s = np.cos(turned), np.sin(turned)
        for k in range(3):
            effect[0, k], effect[1, k] = rotate(c, s, J[0, k], J[1, k])
            effect[2, k] = J[2, k]
        for i in range(6):
            for j in range(6):
                for k in range(3):
                    Q[i, j] += _WEIGHTS[node] * dt * effect[i, k] * rates[k] * effect[j, k]
    return end, F, Q


@kernel
def propagate(x: Array, P: Array, n: int, state: Array, F: Array, Q: Array) -> None:
    """Put a predicted state (d,) in place of the first d entries: F (d, d) is its Jacobian, Q (d, d) the noise."""
    d = len(state)
    FP = np.zeros((d, n))
    for i in range(d):
        for k in range(d):
            if F[i, k] != 0.0:
                for j in range(n):
                    FP[i, j] += F[i, k] * P[k, j]
    for i in range(d):
        x[i] = state[i]
        for j in range(d, n):
            P[i, j] = P[j, i] = FP[i, j]
        for j in range(i + 1):
            entry = Q[i, j]
            for k in range(d):
                entry += FP[i, k] * F[j, k]
            P[i, j] = P[j, i] = entry


@kernel
def advance_by_odometry(x: Array, P: Array, n: int, dt: float, increment: Array, noise: Array) -> None:
    """`by_odometry` for a mean x (n,) and covariance P (n, n) that begin with the pose, in place."""
    state, F, Q = by_odometry(x, dt, increment, noise)
    propagate(x, P, n, state, F, Q)


@kernel
def advance_by_odometry_with_velocity(
    x: Array, P: Array, n: int, dt: float, increment: Array, noise: Array, rates: Array
) -> None:
    """`by_odometry_with_velocity` for a mean x (n,) and covariance P (n, n) that begin with the state, in place."""
    state, F, Q = by_odometry_with_velocity(x[:6], dt, increment, noise, rates)
    propagate(x, P, n, state, F, Q)


@kernel
def advance_at_constant_velocity(x: Array, P: Array, n: int, dt: float, rates: Array) -> None:
    """`at_constant_velocity` for a mean x (n,) and covariance P (n, n) that begin with the state, in place."""
    state, F, Q = at_constant_velocity(x[:6], dt, rates)
    propagate(x, P, n, state, F, Q)
