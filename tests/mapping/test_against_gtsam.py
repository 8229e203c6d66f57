"""Solutions and marginals of the pose graph against those of GTSAM, which nobody here wrote."""

import gtsam
import numpy as np
import pytest

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative, wrap
from lidarcore.mapping import PoseGraph
from lidarcore.mapping.doubt import DOUBTFUL

Edge = tuple[int, int, Array, Array]


def streets(rng: np.random.Generator, nodes: int = 400) -> tuple[list[Array], list[Edge]]:
    """A robot that wanders through streets a metre apart: a way, and loops where it comes by again."""
    true = [np.zeros(3)]
    for _ in range(nodes - 1):
        turn = rng.choice([0.0, 0.0, 0.0, np.pi / 2, -np.pi / 2])
        true.append(compose(true[-1], np.array([1.0, 0.0, turn])))
    pairs = [(k, k + 1) for k in range(nodes - 1)]
    xy = np.array(true)[:, :2]
    for j in range(20, nodes):
        near = np.flatnonzero(np.hypot(*(xy[: j - 15] - xy[j]).T) < 0.5)
        pairs += [(int(i), j) for i in near[:1]]
    edges = []
    for i, j in pairs:
        A = rng.normal(0, 1, (3, 3)) * [0.02, 0.02, 0.008]
        P = A.T @ A + np.diag([1e-4, 1e-4, 2e-5])
        error = rng.multivariate_normal(np.zeros(3), P, method="cholesky")
        edges.append((i, j, relative(true[i], true[j]) + error, P))
    return true, edges


def chained(edges: list[Edge], nodes: int) -> list[Array]:
    """Where the steps alone lead."""
    poses = [np.zeros(3)]
    for _, _, step, _ in edges[: nodes - 1]:
        poses.append(compose(poses[-1], step))
    return poses


def ours(edges: list[Edge], begin: list[Array], doubted: frozenset[int] = frozenset()) -> PoseGraph:
    graph = PoseGraph(begin[0])
    for pose in begin[1:]:
        graph.add(pose)
    for k, (i, j, step, P) in enumerate(edges):
        graph.connect(i, j, step, P, doubted=k in doubted)
    return graph


def theirs(
    edges: list[Edge], begin: list[Array], doubted: frozenset[int] = frozenset()
) -> tuple[Array, gtsam.Marginals, float]:
    """Poses (N, 3), what tells covariances, and chi-square.

    GTSAM's errors are of the inverse measurement times the relative pose, seen from the measured frame: covariances are
    turned into it.
    """
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*begin[0]), gtsam.noiseModel.Constrained.All(3)))
    for k, pose in enumerate(begin):
        values.insert(k, gtsam.Pose2(*pose))
    for k, (i, j, step, P) in enumerate(edges):
        noise = gtsam.noiseModel.Gaussian.Covariance(turned(P, -step[2]))
        if k in doubted:
            kernel = gtsam.noiseModel.mEstimator.DCS.Create(DOUBTFUL)
            noise = gtsam.noiseModel.Robust.Create(kernel, noise)
        graph.add(gtsam.BetweenFactorPose2(i, j, gtsam.Pose2(*step), noise))
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(500)
    parameters.setRelativeErrorTol(1e-14)
    parameters.setAbsoluteErrorTol(1e-14)
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    found = [solved.atPose2(k) for k in range(len(begin))]
    return (
        np.array([[p.x(), p.y(), p.theta()] for p in found]),
        gtsam.Marginals(graph, solved),
        2 * graph.error(solved),
    )


def turned(P: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return R @ P @ R.T


def off(a: Array, b: Array) -> Array:
    difference = a - b
    difference[..., 2] = wrap(difference[..., 2])
    return np.abs(difference)


@pytest.mark.parametrize("seed", [1, 2])
def test_poses_and_covariances_are_those_of_gtsam(seed: int) -> None:
    """Up to what parts an error into place and heading differently: of second order, 1 % of the standard deviations."""
    _, edges = streets(np.random.default_rng(seed))
    begin = chained(edges, 400)
    graph = ours(edges, begin)
    chi2 = graph.optimize(1e-10, rounds=200)
    poses, marginals, theirs_chi2 = theirs(edges, begin)
    assert chi2 == pytest.approx(theirs_chi2, rel=0.005)
    for k in (1, 57, 200, 399):
        P = turned(marginals.marginalCovariance(k), poses[k, 2])
        sigmas = np.sqrt(np.diag(P))
        assert (off(graph.poses[k], poses[k]) < 0.03 * sigmas).all()
        assert np.abs(graph.covariance(k) - P).max() < 0.02 * P.max()
        np.testing.assert_allclose(np.sqrt(np.diag(graph.covariance(k))), sigmas, rtol=0.01)


def test_false_loops_are_doubted_as_by_dynamic_covariance_scaling_in_gtsam() -> None:
    """Eight loops that are metres off: where our graph comes to rest, GTSAM's stays."""
    rng = np.random.default_rng(3)
    _, edges = streets(rng)
    loops = range(399, len(edges))
    for k in rng.choice(loops, 8, replace=False):
        i, j, step, P = edges[k]
        edges[k] = i, j, step + np.array([1.0, -1.0, 0.3]), P
    begin = list(ours(edges[:399], chained(edges, 400)).poses)
    doubted = frozenset(loops)
    graph = ours(edges, begin, doubted)
    graph.optimize(1e-10, rounds=200)
    assert off(graph.poses, np.array(begin)).max() > 0.1
    poses, _, _ = theirs(edges, list(graph.poses), doubted)
    assert off(graph.poses, poses).max() < 0.01
    false = graph.chi_square[399:] > 100
    assert false.sum() == 8
