import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numeric import jacobian

from lidarcore.geometry import act_inverse, compose
from lidarcore.localization.ekf.motion import ConstantVelocity, OdometryMotion, OdometryWithVelocity
from lidarcore.localization.ekf.motion_kernels import arc
from lidarcore.localization.motion_noise import OdometryNoise, VelocityNoise
from lidarcore.scan import Array

metres, angles, rates = st.floats(-20, 20), st.floats(-3, 3), st.floats(-4, 4)
poses = st.tuples(metres, metres, angles).map(np.array)
points = st.tuples(metres, metres).map(np.array)
tiny_rates = rates | st.floats(-0.02, 0.02)
"""Turn rates, also those for which the arc is a series."""


@given(rates, tiny_rates, st.floats(0.01, 1))
def test_jacobian_of_the_arc(v: float, w: float, dt: float) -> None:
    expected = jacobian(lambda u: arc(u[0], u[1], dt)[0], np.array([v, w]))
    np.testing.assert_allclose(arc(v, w, dt)[1], expected, atol=1e-6)


@given(rates, tiny_rates, st.floats(0.01, 1))
def test_the_arc_is_where_many_small_straight_steps_lead(v: float, w: float, dt: float) -> None:
    steps = 4000
    headings = w * dt * (np.arange(steps) + 0.5) / steps
    end = v * dt / steps * np.array([np.cos(headings).sum(), np.sin(headings).sum()])
    np.testing.assert_allclose(arc(v, w, dt)[0], [*end, w * dt], atol=1e-6)


@given(poses, points)
def test_the_measurement_is_range_and_bearing(pose: Array, landmark: Array) -> None:
    x, y = act_inverse(pose, landmark)
    dx, dy = landmark - pose[:2]
    np.testing.assert_allclose(np.hypot(x, y), np.hypot(dx, dy), atol=1e-9)
    np.testing.assert_allclose(
        np.hypot(x, y) * np.exp(1j * (np.arctan2(y, x) + pose[2])), dx + 1j * dy, atol=1e-9
    )


@given(poses, rates, tiny_rates, rates, st.floats(0.01, 0.5))
def test_jacobian_of_the_constant_velocity_model(
    pose: Array, v: float, w: float, u: float, dt: float
) -> None:
    pose[2] = np.clip(pose[2], -0.9, 0.9)
    model, state = ConstantVelocity(VelocityNoise()), np.array([*pose, v, w, u])
    _, F, _ = model.predict(state, dt, None)
    np.testing.assert_allclose(F, jacobian(lambda s: model.predict(s, dt, None)[0], state), atol=1e-6)


def test_velocity_noise_is_that_of_many_small_random_accelerations() -> None:
    """Monte Carlo of the stochastic differential equation, with accelerations small enough to be linear."""
    rng, runs, steps, dt = np.random.default_rng(1), 20_000, 100, 0.4
    noise = VelocityNoise(acceleration=0.02, turn_acceleration=0.02, sideways=0.01)
    x, y, heading = np.zeros(runs), np.zeros(runs), np.full(runs, 0.7)
    v, w, u = np.full(runs, 1.2), np.full(runs, 0.5), np.full(runs, -0.3)
    for _ in range(steps):
        v += noise.acceleration * np.sqrt(dt / steps) * rng.normal(size=runs)
        w += noise.turn_acceleration * np.sqrt(dt / steps) * rng.normal(size=runs)
        u += noise.sideways * np.sqrt(dt / steps) * rng.normal(size=runs)
        x += (v * np.cos(heading) - u * np.sin(heading)) * dt / steps
        y += (v * np.sin(heading) + u * np.cos(heading)) * dt / steps
        heading += w * dt / steps
    _, _, Q = ConstantVelocity(noise).predict(np.array([0, 0, 0.7, 1.2, 0.5, -0.3]), dt, None)
    sampled = np.cov(np.stack([x, y, heading, v, w, u]))
    sigma = np.sqrt(np.diag(sampled))
    np.testing.assert_allclose(Q / np.outer(sigma, sigma), sampled / np.outer(sigma, sigma), atol=0.04)


@given(st.floats(0.01, 2), st.floats(-1, 1), st.integers(2, 20))
def test_odometry_noise_of_a_straight_way_does_not_depend_on_how_it_is_cut(
    way: float, heading: float, steps: int
) -> None:
    """Of the heading at least, and of the position ahead; sideways the heading's error adds up."""
    model = OdometryMotion(OdometryNoise())
    state, P = np.zeros(3), np.zeros((3, 3))
    for _ in range(steps):
        state, F, Q = model.predict(state, 0.1 / steps, np.array([way / steps, 0, 0]))
        P = F @ P @ F.T + Q
    _, _, whole = model.predict(np.zeros(3), 0.1, np.array([way, 0, 0]))
    np.testing.assert_allclose([P[0, 0], P[2, 2]], [whole[0, 0], whole[2, 2]], rtol=1e-9)


@pytest.mark.parametrize("turned", [-0.12, 0.0, 0.12])
def test_an_error_of_odometry_is_one_of_the_pose_and_of_the_velocity(turned: float) -> None:
    """The covariance of a step against that of a hundred thousand increments drawn from the noise."""
    noise, accelerations, dt = OdometryNoise(), VelocityNoise(), 0.1
    increment, rng = np.array([0.08, 0.01, turned]), np.random.default_rng(4)
    model = OdometryWithVelocity(noise, accelerations)
    start = np.array([1.0, 2.0, 0.7, 9.0, 9.0, 9.0])
    _, F, Q = model.predict(start, dt, increment)
    drawn = rng.multivariate_normal(increment, noise.covariance(increment, dt), 100_000, method="cholesky")
    ends = compose(start[:3], drawn)
    velocities = drawn[:, [0, 2, 1]] / dt
    changes = rng.normal(size=velocities.shape) * np.sqrt(
        dt * np.square([accelerations.acceleration, accelerations.turn_acceleration, accelerations.sideways])
    )
    expected = np.cov(np.hstack([ends, velocities + changes]).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(Q / scale, expected / scale, atol=0.02)
    np.testing.assert_array_equal(F[3:], 0.0)
