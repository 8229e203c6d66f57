"""The normal equations of an adjustment: what surfaces say of all poses, what steps say besides, and their solution."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import LinearOperator, cg

from lidarcore.arrays import Array
from lidarcore.geometry import pose_difference, relative, relative_jacobians
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.pose_graph import FIXED

_EXACT = 1e-6  # of the gradient may be left: some ten-thousandths of the step
_ROUNDS = 40  # of conjugate gradients: a factor takes as long as 60 to 130


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """How keyframe j was reached from keyframe i, but for the surfaces that tie them: T_i_j (3,), covariance (3, 3)."""

    i: int
    j: int
    pose: Array
    covariance: Array


class NormalEquations(NamedTuple):
    """H x = -gradient, for corrections x (3 K,) of K poses.

    H = own - lines lines^T: the lines through cells, unknown as well, are eliminated.

    own       (3 K, 3 K) sparse
    lines     (3 K, 2 L) sparse
    gradient  (3 K,)
    """

    own: csr_array
    lines: csr_array
    gradient: Array

    def information(self) -> csc_array:
        """H (3 K, 3 K), which ties all keyframes that saw a surface to each other: nearly dense in a room."""
        return csc_array(self.own - self.lines @ self.lines.T)

    def factored(self) -> Factor:
        """Factor of H.

        Of poses and lines, those of which there are more are eliminated first. Who goes through the same rooms for an
        hour has many poses for each line: H alone would fill gigabytes, and lines do not grow in number.
        """
        poses, lines = self.lines.shape
        if lines > poses:
            return Factor(self.information())
        both = block_array([[self.own, self.lines], [self.lines.T, eye_array(lines)]], format="csc")
        return Factor(both, poses, np.append(np.arange(poses), poses + np.arange(lines) // 2))

    def with_steps(self, poses: Array, steps: list[Step]) -> "NormalEquations":
        """The same at poses (K, 3) with the steps, and the first pose fixed."""
        ends = np.array([(step.i, step.j) for step in steps], np.int64).reshape(-1, 2)
        z = np.array([step.pose for step in steps]).reshape(-1, 3)
        covariances = np.array([step.covariance for step in steps]).reshape(-1, 3, 3)
        a, b = poses[ends[:, 0]], poses[ends[:, 1]]
        J = np.concatenate(relative_jacobians(a, b), -1)
        W = np.linalg.inv(covariances)
        blocks = np.swapaxes(J, -1, -2) @ W @ J
        index = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        g = self.gradient.copy()
        np.add.at(g, index, np.einsum("nki,nkl,nl->ni", J, W, pose_difference(relative(a, b), z)))
        row, column = np.broadcast_arrays(index[:, :, None], index[:, None, :])
        fixed = np.zeros(len(g))
        fixed[:3] = FIXED
        tied = csr_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=self.own.shape)
        return NormalEquations(csr_array(self.own + tied + diags_array(fixed)), self.lines, g)

    def solution(self, near: Factor | None) -> tuple[Array, Factor]:
        """x (3 K,), and a factor for the next equations: the given one, of equations `near` these, or their own.

        Conjugate gradients, preconditioned with a factor of equations that are near, take a tenth of the time of a new
        factor [Golub & Van Loan, Matrix Computations, 11.5]. Where it is not near enough, these are factored.
        """
        if near is not None and len(near) == self.own.shape[0]:
            H = LinearOperator(self.own.shape, lambda x: self.own @ x - self.lines @ (self.lines.T @ x))
            M = LinearOperator(self.own.shape, near.solve)
            x, failed = cg(H, -self.gradient, M=M, rtol=_EXACT, maxiter=_ROUNDS)
            if not failed:
                return x, near
        near = self.factored()
        return near.solve(-self.gradient), near
