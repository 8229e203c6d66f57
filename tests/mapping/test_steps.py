"""What is kept of how a keyframe was reached: motion alone counts less, the more what was seen contradicts it."""

import numpy as np
import pytest

from lidarcore.geometry import UncertainPose
from lidarcore.mapping.graph.known import Known
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.loops.steps import Steps

SEEN = UncertainPose(np.array([1.0, 0.0, 0.0]), np.diag([0.01, 0.01, 0.005]) ** 2)
SIGMA = np.array([0.1, 0.1, 0.05])


@pytest.mark.parametrize(("off", "weight"), [(0.0, 1.0), (2.5, 1.0), (10.0, (2 / (1 + 100 / 11.3449)) ** 2)])
def test_wheels_that_contradict_what_was_seen_count_less(off, weight):
    """By [Agarwal et al. 2013] with 11.3449, the 99 % quantile of chi-square with three degrees of freedom."""
    graph = PoseGraph()
    graph.add(SEEN.pose)
    steps = Steps(graph)
    steps.add(0, 1, UncertainPose(SEEN.pose + np.array([off * SIGMA[0], 0, 0]), np.diag(SIGMA**2)), SEEN)
    together = Known(np.zeros(2, np.int64), np.ones((1, 1), bool), np.ones(2))
    (step,) = steps.besides(together)
    np.testing.assert_allclose(step.covariance, np.diag(SIGMA**2) / weight, rtol=1e-3)
    graph.move(graph.poses + np.array([[0, 0, 0], [3.0, 0, 0]]))  # however the poses move
    (again,) = steps.besides(together)
    assert np.array_equal(again.covariance, step.covariance)


def test_what_need_not_be_the_same_surfaces_is_tied_by_what_was_seen():
    graph = PoseGraph()
    graph.add(SEEN.pose)
    steps = Steps(graph)
    steps.add(0, 1, UncertainPose(SEEN.pose, np.diag(SIGMA**2)), SEEN)
    (step,) = steps.besides(Known(np.arange(2), np.eye(2, dtype=bool), np.ones(2)))
    assert np.array_equal(step.covariance, SEEN.covariance)
