"""Normal equations of an adjustment, against dense algebra and finite differences."""

import numpy as np
import pytest
from scipy.sparse import csc_array, csr_array

from lidarcore.geometry import pose_difference, relative
from lidarcore.mapping.graph.equations import NormalEquations, Step
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.recovery import Recovery


def made(rng, stiffness, lines=20) -> NormalEquations:
    """Equations of 30 poses and so many lines, the unknowns as stiff as given (90,)."""
    shape = 90, 2 * lines
    lines = rng.normal(0, 0.1, shape) * (rng.random(shape) < 0.2)
    own = np.diag(stiffness) + lines @ lines.T
    return NormalEquations(csr_array(own), csr_array(lines), rng.normal(size=90))


@pytest.mark.parametrize("near", [0.5, 2.0])
def test_a_factor_of_other_equations_solves_these(near):
    rng = np.random.default_rng(0)
    stiffness = rng.uniform(1, 1e4, 90)
    equations = made(rng, stiffness)
    other = made(rng, stiffness * near ** rng.uniform(-1, 1, 90))
    dense = equations.own.toarray() - equations.lines.toarray() @ equations.lines.toarray().T
    truth = np.linalg.solve(dense, -equations.gradient)
    np.testing.assert_allclose(equations.information().toarray(), dense, atol=1e-12)
    known = Factor(other.information())
    found, still = equations.solution(known)
    assert still is known
    off = found - truth
    assert off @ dense @ off < 1e-8 * (truth @ dense @ truth)


@pytest.mark.parametrize("unlike", [None, Factor(csc_array(np.eye(90))), Factor(csc_array(np.eye(87)))])
def test_without_a_factor_that_is_near_they_are_factored(unlike):
    """As if everything were equally stiff: conjugate gradients alone would take more rounds than they are given."""
    rng = np.random.default_rng(1)
    equations = made(rng, np.geomspace(1, 1e8, 90))
    truth = np.linalg.solve(equations.information().toarray(), -equations.gradient)
    found, near = equations.solution(unlike)
    np.testing.assert_allclose(found, truth, rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(near.solve(-equations.gradient), truth, rtol=1e-6, atol=1e-14)


@pytest.mark.parametrize("lines", [20, 60])
def test_a_factor_is_that_of_the_poses_whether_lines_are_fewer_or_more(lines):
    rng = np.random.default_rng(3)
    equations = made(rng, rng.uniform(1, 100, 90), lines)
    found, inverse = equations.factored(), np.linalg.inv(equations.information().toarray())
    b = rng.normal(size=(90, 2))
    np.testing.assert_allclose(found.solve(b), inverse @ b, rtol=1e-9, atol=1e-12)
    expected = [inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(30)]
    np.testing.assert_allclose(Recovery(found).diagonal(), expected, rtol=1e-9, atol=1e-12)
    assert len(found.lower.pivots) == (130 if lines == 20 else 90)


def test_steps_add_the_gradient_and_the_curvature_of_their_squared_distances():
    rng = np.random.default_rng(2)
    poses = rng.normal(0, [1, 1, 0.5], (3, 3))
    empty = NormalEquations(csr_array((9, 9)), csr_array((9, 0)), np.zeros(9))
    roots = [rng.normal(0, 0.1, (3, 3)) for _ in range(2)]
    steps = [
        Step(i, j, relative(poses[i], poses[j]) + rng.normal(0, 1e-4, 3), root @ root.T)
        for (i, j), root in zip([(0, 1), (2, 1)], roots, strict=True)
    ]

    def whitened(x):
        at = poses + x.reshape(3, 3)
        return np.concatenate(
            [
                np.linalg.solve(root, pose_difference(relative(at[step.i], at[step.j]), step.pose))
                for step, root in zip(steps, roots, strict=True)
            ]
        )

    J = np.stack([(whitened(d) - whitened(-d)) / 2e-6 for d in 1e-6 * np.eye(9)], -1)
    found = empty.with_steps(poses, steps)
    H = found.information().toarray()
    assert (np.diag(H)[:3] > 1e6 * np.diag(J.T @ J)[:3]).all()  # the first pose is fixed
    H[:3, :3] = (J.T @ J)[:3, :3]
    np.testing.assert_allclose(H, J.T @ J, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(found.gradient, J.T @ whitened(np.zeros(9)), rtol=1e-5, atol=1e-6)
