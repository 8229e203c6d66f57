"""Landmarks that are one and the same thing are merged, others are not."""

import numpy as np
import pytest

from lidarcore.localization import LocalizationSettings
from lidarcore.localization.ekf.joint import JointState
from lidarcore.localization.ekf.register import find_duplicate

SETTINGS = LocalizationSettings()
ONE = np.array([True, False])
BOTH = np.array([True, True])
KINDS = np.array(["corner", "corner"])


def seen_twice(distance: float, sigma: float = 0.01) -> JointState:
    """Two landmarks so many metres apart, each with this standard deviation, from a sensor of uncertain pose."""
    joint = JointState(np.array([1.0, 2.0, 0.7]), np.diag([0.5, 0.5, 0.2]))
    joint.add(np.array([[2.0, 1.0]]), sigma**2 * np.eye(2)[None])
    joint.add(np.array([[2.0, 1.0 + distance]]), sigma**2 * np.eye(2)[None])
    return joint


def test_landmarks_nearer_than_their_errors_are_one_however_uncertain_the_pose() -> None:
    assert find_duplicate(seen_twice(0.02), KINDS, BOTH, ONE, SETTINGS) == (0, 1)


@pytest.mark.parametrize("case", ["apart", "both seen", "neither seen", "other kind", "tentative"])
def test_others_are_two(case: str) -> None:
    joint = seen_twice(0.15 if case == "apart" else 0.02)
    kinds = np.array(["corner", "post"]) if case == "other kind" else KINDS
    confirmed = ONE if case == "tentative" else BOTH
    seen = {"both seen": BOTH, "neither seen": ~BOTH}.get(case, ONE)
    assert find_duplicate(joint, kinds, confirmed, seen, SETTINGS) is None


def test_what_is_far_apart_is_not_merged_for_its_uncertainty_alone() -> None:
    assert find_duplicate(seen_twice(0.5, sigma=1.0), KINDS, BOTH, ONE, SETTINGS) is None


def test_a_merged_landmark_lies_where_both_say_together_and_tells_nothing_of_the_pose() -> None:
    joint = seen_twice(0.02)
    middle, (pose, P) = joint.landmarks.mean(axis=0), (joint.state, joint.state_covariance)
    before = joint.expected(np.array([0]))[1]
    joint.fuse(0, 1)
    np.testing.assert_allclose(joint.landmarks, [middle], atol=1e-3)
    np.testing.assert_allclose(joint.expected(np.array([0]))[1], before / 2, rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(joint.state, pose, atol=1e-9)
    np.testing.assert_allclose(joint.state_covariance, P, atol=1e-9)
