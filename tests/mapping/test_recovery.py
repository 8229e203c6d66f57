"""Covariances from a sparse factor against those of the dense inverse."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, random_array

from lidarcore.geometry import compose, relative
from lidarcore.mapping import PoseGraph
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.recovery import Recovery

CORRELATED = np.array([[4, 1, 0.5], [1, 3, -0.2], [0.5, -0.2, 1]]) * 1e-4
PLAIN = np.diag([4e-4, 3e-4, 1e-4])  # some entries of the factor are exactly 0, and not kept


def rounds(P, count=90, one=20):
    """A graph of a robot that drives a circle of 20 nodes several times, tied to the rounds before here and there."""
    rng = np.random.default_rng(3)
    at = 2 * np.pi * np.arange(count) / one
    poses = np.stack([6 * np.sin(at), 6 - 6 * np.cos(at), at], -1)
    graph = PoseGraph(poses[0])
    for k in range(1, count):
        graph.add(poses[k])
        graph.connect(k - 1, k, relative(poses[k - 1], poses[k]) + 0.01 * rng.normal(size=3), P)
        if k > one and k % 3 == 0:
            graph.connect(k - one - k % 2, k, relative(poses[k - one - k % 2], poses[k]), P)
    graph.optimize(1e-10)
    return graph


def dense(graph, P):
    """The joint covariance (3 N, 3 N) of the poses, by numeric Jacobians of all edges and a dense inverse."""
    poses, information = graph.poses, np.linalg.inv(P)
    H = np.zeros((poses.size, poses.size))
    for i, j in graph.edges:
        J = np.zeros((3, poses.size))
        for node in (i, j):
            for m in range(3):
                moved = [poses.copy(), poses.copy()]
                for way, sign in zip(moved, (1, -1), strict=True):
                    way[node, m] += sign * 1e-6
                ahead, behind = (relative(way[i], way[j]) for way in moved)
                J[:, 3 * node + m] = (ahead - behind) / 2e-6
        H += J.T @ information @ J
    joint = np.zeros_like(H)
    joint[3:, 3:] = np.linalg.inv(H[3:, 3:])
    return joint


@pytest.mark.parametrize("P", [CORRELATED, PLAIN], ids=["correlated", "plain"])
def test_covariances_of_all_nodes_are_those_of_the_dense_inverse(P):
    graph = rounds(P)
    joint = dense(graph, P)
    own = [joint[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(graph))]
    np.testing.assert_allclose(graph.covariances(), own, rtol=1e-4, atol=1e-9)


def test_nodes_that_are_appended_one_by_one_have_the_covariance_that_a_new_factor_gives():
    graph = rounds(CORRELATED)
    graph.covariances()
    for k in range(70):  # the sixth hangs on a node before the last: only a new factor knows it
        graph.connect(
            len(graph) - 1 - (k == 5),
            graph.add(compose(graph.poses[-1], np.array([0.3, 0, 0.1]))),
            [0.3, 0.01, 0.1],
            CORRELATED,
        )
        newest = graph.covariance(len(graph) - 1)
    joint = dense(graph, CORRELATED)
    np.testing.assert_allclose(newest, joint[-3:, -3:], rtol=1e-4, atol=1e-9)
    own = [joint[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(graph))]
    np.testing.assert_allclose(graph.covariances(), own, rtol=1e-4, atol=1e-9)
    A, B = np.split(_jacobian(graph.poses[40], graph.poses[-2]), 2, axis=1)
    both = np.r_[120:123, len(joint) - 6 : len(joint) - 3]
    J = np.hstack([A, B])
    expected = J @ joint[np.ix_(both, both)] @ J.T
    np.testing.assert_allclose(graph.relative(40, len(graph) - 2).covariance, expected, rtol=1e-4, atol=1e-9)


def test_blocks_that_are_asked_for_one_after_the_other_are_those_asked_for_singly():
    rng = np.random.default_rng(0)
    half = random_array((3 * 21, 3 * 21), density=0.1, rng=rng) + diags_array(np.ones(63))
    H = csc_array(half @ half.T)
    inverse, recovery = np.linalg.inv(H.toarray()), Recovery(Factor(H))
    for i, j in [(20, j) for j in range(20)] + [(j + 1, j) for j in (7, 3, 4, 12)]:
        expected = inverse[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
        np.testing.assert_allclose(recovery.block(i, j), expected, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(recovery.block(j, i), expected.T, rtol=1e-6, atol=1e-9)


def _jacobian(a, b):
    """(3, 6) of the pose b seen from a, by both."""
    x = np.concatenate([a, b])
    columns = []
    for m in range(6):
        step = 1e-6 * np.eye(6)[m]
        columns.append(
            (relative((x + step)[:3], (x + step)[3:]) - relative((x - step)[:3], (x - step)[3:])) / 2e-6
        )
    return np.stack(columns, -1)
