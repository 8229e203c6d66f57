"""The kernels against the matrices of the textbook and finite differences."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numeric import jacobian

from lidarcore.geometry import act_inverse
from lidarcore.localization.ekf import sighting_kernels
from lidarcore.localization.ekf.motion import ConstantVelocity, Motion, OdometryMotion
from lidarcore.localization.motion_noise import OdometryNoise, VelocityNoise
from lidarcore.scan import Array, Ints

seeds = st.integers(0, 2**32 - 1)


def gaussian(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """A mean (n,) and a covariance (n, n) with large and small eigenvalues, whose heading is no turn away from 0."""
    axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    P = axes * 10 ** rng.uniform(-6, 1, n) @ axes.T
    x = rng.normal(0, 3, n)
    x[2] = rng.uniform(-3, 3)
    return x, (P + P.T) / 2


def covariances(rng: np.random.Generator, count: int) -> Array:
    roots: Array = rng.normal(size=(count, 2, 2))
    return roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(2)


def sightings(rng: np.random.Generator, x: Array, count: int) -> tuple[Ints, Array, Array, Array]:
    """Rows of landmarks in x (K,), -1 for given ones; where all are, z (K, 2); H (2 K, n); noise (K, 2, 2)."""
    rows = rng.choice([-1, *range(3, len(x) - 1, 2)], count)
    given_ones = rng.normal(0, 4, (count, 2))

    def see(state: Array) -> Array:
        landmarks = np.array(
            [state[r : r + 2] if r >= 0 else m for r, m in zip(rows, given_ones, strict=True)]
        )
        return act_inverse(state[:3], landmarks.reshape(-1, 2)).ravel()

    return rows, see(x).reshape(-1, 2), jacobian(see, x), 0.01 * covariances(rng, count)


def block_diagonal(blocks: Array) -> Array:
    matrix = np.zeros((2 * len(blocks), 2 * len(blocks)))
    for k, block in enumerate(blocks):
        matrix[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    return matrix


@given(seeds, st.integers(0, 5), st.integers(0, 12))
def test_one_sighting_after_the_other_corrects_like_all_at_once(
    seed: int, landmarks: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    n = 3 + 2 * landmarks
    x, P = gaussian(rng, n)
    rows, z, H, noise = sightings(rng, x, count)
    innovation, R = rng.normal(0, 0.1, (count, 2)), block_diagonal(noise)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    expected_x = x + K @ innovation.ravel()
    expected_P = (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T + K @ R @ K.T  # Joseph
    found_S = sighting_kernels.innovation_covariance(x, P, z, noise, rows)
    np.testing.assert_allclose(found_S, S, atol=1e-7 * (1 + np.abs(S).max(initial=0)))
    sighting_kernels.correct(x, P, n, z, innovation, noise, rows)
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_allclose(P, expected_P, atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * x[2]), np.exp(1j * expected_x[2]), atol=1e-6)
    np.testing.assert_allclose(np.delete(x, 2), np.delete(expected_x, 2), atol=1e-6)
    assert -np.pi < x[2] <= np.pi


@given(seeds, st.integers(0, 4), st.booleans())
def test_a_prediction_in_place_is_that_of_the_matrices(seed: int, landmarks: int, odometry: bool) -> None:
    rng = np.random.default_rng(seed)
    model: Motion = OdometryMotion(OdometryNoise()) if odometry else ConstantVelocity(VelocityNoise())
    d = model.size
    x, P = gaussian(rng, d + 2 * landmarks)
    increment = rng.normal(size=3) if odometry else None
    state, F, Q = model.predict(x[:d].copy(), 0.3, increment)
    full = np.eye(len(x))
    full[:d, :d] = F
    expected_x, expected_P = np.concatenate([state, x[d:]]), full @ P @ full.T
    expected_P[:d, :d] += Q
    model.advance(x, P, len(x), 0.3, increment)
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_allclose(P, expected_P, atol=1e-12)
    np.testing.assert_allclose(x, expected_x, atol=1e-12)


@given(seeds, st.integers(1, 5))
def test_where_landmarks_are_expected_and_how_well(seed: int, landmarks: int) -> None:
    rng = np.random.default_rng(seed)
    x, P = gaussian(rng, 3 + 2 * landmarks)
    rows = 3 + 2 * np.arange(landmarks)
    cross = np.array([P[:3, r : r + 2] for r in rows])
    own = np.array([P[r : r + 2, r : r + 2] for r in rows])
    z, S = sighting_kernels.expect(x, P, x[3:].reshape(-1, 2), cross, own)
    for k, row in enumerate(rows.tolist()):

        def see(state: Array, row: int = row) -> Array:
            return act_inverse(state[:3], state[row : row + 2])

        H = jacobian(see, x)
        np.testing.assert_allclose(z[k], see(x), atol=1e-12)
        np.testing.assert_allclose(S[k], H @ P @ H.T, atol=1e-7 * (1 + np.abs(S[k]).max()))


@given(seeds, st.integers(0, 6), st.integers(0, 6))
def test_squared_distances_of_all_sightings_to_all_landmarks(seed: int, count: int, landmarks: int) -> None:
    rng = np.random.default_rng(seed)
    xy, z = rng.normal(size=(count, 2)), rng.normal(size=(landmarks, 2))
    R, S = (covariances(rng, m) for m in (count, landmarks))
    found = sighting_kernels.all_squared_distances(xy, R, z, S)
    for k, i in np.ndindex(count, landmarks):
        nu = xy[k] - z[i]
        np.testing.assert_allclose(found[k, i], nu @ np.linalg.solve(R[k] + S[i], nu), rtol=1e-9)
    near = {i for i in range(landmarks) for k in range(count) if found[k, i] <= 2}
    assert sighting_kernels.within_any(found, 2.0).tolist() == sorted(near)
