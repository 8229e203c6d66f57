"""A node that was looked for where the graph expects it is not looked for again, until the graph expects another."""

import numpy as np
import pytest

from lidarcore.geometry import UncertainPose
from lidarcore.mapping.loops.consistency import Loop
from lidarcore.mapping.loops.tried import Tried

SIGMA = np.array([0.5, 0.2, 0.1])
EXPECTED = UncertainPose(np.array([2.0, 1.0, np.pi]), np.diag(SIGMA**2))
FOUND = [Loop(3, 40, EXPECTED.pose, np.eye(3), 0.8)]


@pytest.fixture
def tried():
    """Node 40 was found at node 3, and nothing at node 7."""
    tried = Tried()
    tried.put(3, 40, EXPECTED, FOUND)
    tried.put(7, 40, EXPECTED, [])
    return tried


def test_what_was_found_where_the_graph_expects_the_same_is_found_again(tried):
    assert tried.get(3, 40, EXPECTED) is FOUND
    assert tried.get(7, 40, EXPECTED) == []


def test_what_was_not_tried_is_not_known(tried):
    assert tried.get(3, 41, EXPECTED) is None


@pytest.mark.parametrize("axis", range(3))
def test_a_pose_may_move_by_a_twentieth_of_its_deviation_but_not_by_a_fifth(tried, axis):
    """Also where its heading is turned past half a turn."""
    for share, is_known in ((0.05, True), (0.2, False), (-0.2, False)):
        pose = EXPECTED.pose + share * SIGMA * (np.arange(3) == axis)
        pose[2] = np.arctan2(np.sin(pose[2]), np.cos(pose[2]))
        assert (tried.get(3, 40, EXPECTED._replace(pose=pose)) is FOUND) == is_known


@pytest.mark.parametrize(("factor", "is_known"), [(0.95, True), (1.05, True), (0.8, False), (1.2, False)])
def test_a_covariance_may_change_by_a_twentieth_but_not_by_a_fifth(tried, factor, is_known):
    expected = EXPECTED._replace(covariance=factor * EXPECTED.covariance)
    assert (tried.get(3, 40, expected) is FOUND) == is_known


def test_what_two_axes_share_counts_as_what_each_has(tried):
    """An expectation that is as uncertain along both, but turned, is another."""
    covariance = EXPECTED.covariance.copy()
    covariance[0, 1] = covariance[1, 0] = 0.3 * SIGMA[0] * SIGMA[1]
    assert tried.get(3, 40, EXPECTED._replace(covariance=covariance)) is None
