"""The pose graph against scipy's least squares, dense algebra and finite differences."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from lidarcore.errors import CovarianceError, LocalizationError
from lidarcore.geometry import compose, inverse, wrap
from lidarcore.mapping import PoseGraph
from lidarcore.mapping.graph.edges import edge_errors, linearise

TRUE = np.array([[2 * np.sin(a), 2 - 2 * np.cos(a), a] for a in np.linspace(0, 1.9 * np.pi, 9)])
P = np.array([[4, 1, 0.5], [1, 3, -0.2], [0.5, -0.2, 1]]) * 1e-3


def ring(rng):
    """A graph around a circle, closed at its end, whose nodes begin off; with what its edges say."""
    graph = PoseGraph(TRUE[0])
    for pose in TRUE[1:]:
        graph.add(pose + rng.normal(0, 0.2, 3))
    ends = [(k, k + 1) for k in range(8)] + [(8, 0), (2, 6), (7, 1)]
    relatives = [
        compose(inverse(TRUE[i]), TRUE[j]) + rng.multivariate_normal(np.zeros(3), P, method="cholesky")
        for i, j in ends
    ]
    for (i, j), relative in zip(ends, relatives, strict=True):
        graph.connect(i, j, relative, P)
    return graph, np.array(ends), np.array(relatives)


def residuals(poses, ends, relatives):
    """Errors of all edges in standard deviations, written with complex numbers."""
    z, turns = poses[:, 0] + 1j * poses[:, 1], np.exp(1j * poses[:, 2])
    i, j = ends.T
    there = (z[j] - z[i]) / turns[i]
    turn = np.angle(turns[j] / turns[i] * np.exp(-1j * relatives[:, 2]))
    errors = np.stack([there.real - relatives[:, 0], there.imag - relatives[:, 1], turn], -1)
    return np.linalg.solve(np.linalg.cholesky(P), errors.T).T


def test_the_graph_ends_where_least_squares_does():
    graph, ends, relatives = ring(np.random.default_rng(1))

    def free(x):
        return residuals(np.vstack([TRUE[0], x.reshape(-1, 3)]), ends, relatives).ravel()

    other = least_squares(free, graph.poses[1:].ravel(), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    chi2 = graph.optimize(1e-9)
    off = graph.poses[1:] - other.x.reshape(-1, 3)
    off[:, 2] = wrap(off[:, 2])
    assert np.abs(off).max() < 1e-6
    assert chi2 == pytest.approx(2 * other.cost, rel=1e-6)
    assert graph.chi_square.sum() == pytest.approx(chi2, rel=1e-6)
    np.testing.assert_array_equal(graph.poses[0], TRUE[0])
    dense = np.linalg.inv(other.jac.T @ other.jac)
    for k in (1, 5, 8):
        own = dense[3 * k - 3 : 3 * k, 3 * k - 3 : 3 * k]
        np.testing.assert_allclose(graph.covariance(k), own, rtol=1e-4, atol=1e-9)


def test_relative_covariances_come_from_the_joint_one():
    graph, ends, relatives = ring(np.random.default_rng(2))
    graph.optimize(1e-9)

    def free(x):
        return residuals(np.vstack([TRUE[0], x.reshape(-1, 3)]), ends, relatives).ravel()

    x = graph.poses[1:].ravel()
    joint = np.linalg.inv(_jacobian(free, x).T @ _jacobian(free, x))

    def seen(x):
        return compose(inverse(x[6:9]), x[18:21])

    J = _jacobian(seen, x)
    pose, covariance = graph.relative(3, 7)
    np.testing.assert_allclose(pose, seen(x), atol=1e-12)
    np.testing.assert_allclose(covariance, J @ joint @ J.T, rtol=1e-5, atol=1e-10)


def test_the_gradient_and_the_information_are_those_of_chi_square():
    rng = np.random.default_rng(3)
    graph, ends, relatives = ring(rng)
    poses, W = graph.poses, np.tile(np.linalg.inv(P), (len(ends), 1, 1))

    def chi2(x):
        return np.array([edge_errors(x.reshape(-1, 3), ends, relatives, W).sum() / 2])

    blocks, b = np.empty((len(ends), 6, 6)), np.zeros(poses.size)
    linearise(poses, ends, relatives, W, np.full(len(ends), np.inf), blocks, b)
    np.testing.assert_allclose(_jacobian(chi2, poses.ravel())[0], b, rtol=1e-6, atol=1e-4)
    H = np.zeros((poses.size, poses.size))
    for (i, j), block in zip(ends, blocks, strict=True):
        index = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
        H[np.ix_(index, index)] += block
    J = _jacobian(lambda x: residuals(x.reshape(-1, 3), ends, relatives).ravel(), poses.ravel())
    np.testing.assert_allclose(H, J.T @ J, rtol=1e-6, atol=1e-3)


def test_a_false_loop_among_true_ones_is_doubted():
    rng = np.random.default_rng(4)
    graph, _, _ = ring(rng)
    graph.optimize()
    before, false = graph.poses, np.array([1.5, -1.0, 0.4])
    graph.connect(0, 4, compose(inverse(TRUE[0]), TRUE[4]) + false, P, doubted=True)
    graph.optimize()
    assert np.abs(graph.poses - before)[:, :2].max() < 0.02


def test_a_true_loop_bends_a_stiff_graph():
    """A long way that drifted by half a metre: the loop is hundreds of its own standard deviations off at first."""
    step, bent = np.array([1.0, 0, 2 * np.pi / 60]), np.array([1.0, 0.0, 2 * np.pi / 60 - 0.003])
    graph, sharp = PoseGraph(), np.diag([0.02, 0.02, 0.006]) ** 2
    true = [np.zeros(3)]
    for k in range(60):
        graph.add(compose(graph.poses[k], bent))
        graph.connect(k, k + 1, bent, sharp)
        true.append(compose(true[-1], step))
    graph.connect(0, 60, true[-1], np.diag([0.003, 0.003, 0.002]) ** 2, doubted=True)
    assert graph.chi_square[-1] > 1e4
    graph.optimize()
    assert graph.chi_square[-1] < 11.3
    assert np.hypot(*(graph.poses - true)[:, :2].T).max() < 0.1


@pytest.mark.parametrize("seed", range(20))
def test_a_vague_chain_that_is_bent_hard_does_not_fly_apart(seed):
    """Whole Gauss-Newton steps lead some of these graphs millions of metres away."""
    rng, graph, pose = np.random.default_rng(seed), PoseGraph(), np.zeros(3)
    for k in range(1, 8):
        step = np.array([5.0, 0.0, rng.normal(0, 0.8)])
        pose = compose(pose, step)
        graph.add(pose)
        graph.connect(k - 1, k, step, np.diag([0.5, 0.5, 1.5]) ** 2)
    for i, j in ((0, 7), (2, 5)):
        graph.connect(i, j, rng.normal(0, [4, 4, 2]), np.diag([0.02, 0.02, 0.01]) ** 2)
    before = graph.chi_square.sum()
    graph.optimize()
    assert graph.chi_square.sum() < 0.01 * before
    assert np.abs(graph.poses[:, :2]).max() < 40


def test_a_node_that_hangs_on_nothing_is_told_and_nothing_moves():
    graph, _, _ = ring(np.random.default_rng(5))
    graph.add([9.0, 9.0, 0.0])
    graph.add([9.0, 8.0, 0.0])
    graph.connect(9, 10, [0.0, -1.0, 0.0], P)
    before = graph.poses
    with pytest.raises(LocalizationError, match="from node 0 to node 9"):
        graph.optimize()
    with pytest.raises(LocalizationError, match="from node 0 to node 9"):
        graph.covariance(3)
    np.testing.assert_array_equal(graph.poses, before)


@pytest.mark.parametrize(
    ("edge", "error"),
    [
        ((0, 0, [1, 0, 0], P), LocalizationError),
        ((0, 99, [1, 0, 0], P), LocalizationError),
        ((-1, 1, [1, 0, 0], P), LocalizationError),
        ((0, 1, [1, np.nan, 0], P), LocalizationError),
        ((0, 1, [1, 0, 0], np.zeros((3, 3))), CovarianceError),
        ((0, 1, [1, 0, 0], np.diag([1, 1, -1.0])), CovarianceError),
        ((0, 1, [1, 0, 0], np.diag([1, 1, np.inf])), CovarianceError),
    ],
)
def test_bad_edges_are_told_and_leave_the_graph_as_it_was(edge, error):
    graph, _, _ = ring(np.random.default_rng(6))
    chi2 = graph.optimize()
    with pytest.raises(error):
        graph.connect(*edge)
    assert len(graph.edges) == 11
    assert graph.optimize() == pytest.approx(chi2)


def _jacobian(function, at, step=1e-6):
    columns = [(function(at + d) - function(at - d)) / (2 * step) for d in step * np.eye(len(at))]
    return np.stack(columns, -1)
