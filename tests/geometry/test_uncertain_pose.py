"""Poses with covariances: what they become together, against draws and other optimisers."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from lidarcore.geometry import UncertainPose, pose_difference
from lidarcore.scan import Array

POSE = np.array([1.0, -2.0, 3.1])


def covariance(seed: int) -> Array:
    root = np.random.default_rng(seed).normal(size=(3, 3))
    C: Array = 1e-3 * (root @ root.T + 0.1 * np.eye(3))
    return C


def test_an_estimate_that_is_told_twice_is_no_better() -> None:
    one = UncertainPose(POSE, covariance(1))
    both = one.intersect(one)
    np.testing.assert_allclose(both.pose, one.pose)
    np.testing.assert_allclose(both.covariance, one.covariance)


def test_the_weight_is_that_of_the_least_determinant() -> None:
    P, Q = covariance(2), covariance(3)
    both = UncertainPose(POSE, P).intersect(UncertainPose(POSE, Q))

    def log_det(weight: float) -> float:
        joined = np.linalg.inv(weight * np.linalg.inv(P) + (1 - weight) * np.linalg.inv(Q))
        return float(np.linalg.slogdet(joined)[1])

    best = minimize_scalar(log_det, bounds=(0, 1), method="bounded").fun
    assert np.linalg.slogdet(both.covariance)[1] == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9, 1.0])
def test_it_claims_no_more_than_is_true_however_the_errors_depend_on_each_other(correlation: float) -> None:
    P, Q = covariance(4), covariance(5)
    A, B = np.linalg.cholesky(P), np.linalg.cholesky(Q)
    both = UncertainPose(POSE, P).intersect(UncertainPose(POSE, Q))
    rng, errors = np.random.default_rng(6), []
    for _ in range(2000):
        u, v = rng.normal(size=(2, 3))
        v = correlation * u + np.sqrt(1 - correlation**2) * v
        joined = UncertainPose(POSE + A @ u, P).intersect(UncertainPose(POSE + B @ v, Q))
        errors.append(pose_difference(joined.pose, POSE))
    true = np.cov(np.array(errors).T)
    # Draws make the largest ratio of 3 x 3 covariances up to 1.2 with a chance of 1e-6.
    assert np.linalg.eigvals(np.linalg.solve(both.covariance, true)).real.max() < 1.2


def test_headings_are_joined_across_the_seam() -> None:
    one = UncertainPose(np.array([0.0, 0.0, np.pi - 0.01]), np.eye(3))
    other = UncertainPose(np.array([0.0, 0.0, -np.pi + 0.01]), np.diag([1.0, 1.0, 0.99]))
    assert abs(one.intersect(other).pose[2]) > np.pi - 0.011
