"""Covariances of the nodes of a pose graph from a sparse factor of its information."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import UncertainPose, relative_jacobians
from lidarcore.geometry.kernels import relative_with_covariance
from lidarcore.mapping.graph.factor import Factor

_KEPT = 3_000_000  # rows of three columns each: 72 MB
_AHEAD = 8  # nodes whose columns are solved for together, which takes little more than those of one
_DIGITS = 1e-8  # share of a covariance that is left of it with at least three digits


class Recovery:
    """Blocks (3, 3) of the joint covariance of N nodes, by their information H (3 N, 3 N).

    Single blocks come from three columns at a time [Eustice et al. 2006], those on the diagonal from the entries of
    the factor alone [Kaess & Dellaert 2009]: all columns together would take 72 N² bytes.

    factor  of H
    """

    def __init__(self, factor: Factor) -> None:
        self.factor = factor
        self._count = len(factor) // 3  # of the nodes that the factor knows
        self._own: Array | None = None
        self._columns: dict[int, Array] = {}
        # Of each node after those of the factor: how it moves with the factor's last one, and its own covariance.
        self._tail: list[tuple[Array, Array]] = []

    def __len__(self) -> int:
        return self._count + len(self._tail)

    def append(self, jacobian: Array, covariance: Array) -> None:
        """One more node, that follows the last one by a Jacobian (3, 3), and has a covariance (3, 3) besides."""
        last = len(self) - 1
        moves = self._tail[-1][0] if self._tail else np.eye(3)
        self._tail.append((jacobian @ moves, jacobian @ self.block(last, last) @ jacobian.T + covariance))

    def block(self, i: int, j: int) -> Array:
        """Covariance (3, 3) of node i with node j."""
        if i < j:
            return np.ascontiguousarray(self.block(j, i).T)
        if i < self._count:
            return self._diagonal[i] if i == j else np.ascontiguousarray(self._column(i)[3 * j : 3 * j + 3].T)
        moves, own = self._tail[i - self._count]
        if i == j:
            return own
        if j < self._count:
            return moves @ self.block(self._count - 1, j)
        before, shared = self._tail[j - self._count]
        found: Array = moves @ np.linalg.solve(before, shared)
        return found

    def relative(self, i: int, j: int, poses: Array) -> UncertainPose:
        """T_i_j of the nodes, whose poses are (N, 3), with its covariance.

        Where both lie so vaguely that the difference of their blocks has no digits left, what ties them is solved for.
        """
        own, other = self.block(i, i), self.block(j, j)
        pose, P = relative_with_covariance(poses[i], poses[j], own, self.block(i, j), other)
        if max(i, j) < self._count and _size(P) < _DIGITS * (_size(own) + _size(other)):
            P = self._tied(i, j, *relative_jacobians(poses[i], poses[j]))
        return UncertainPose(pose, P)

    def _tied(self, i: int, j: int, A: Array, B: Array) -> Array:
        """Covariance (3, 3) of A times what node i is off, with B times what node j is."""
        first, second = (slice(3 * k, 3 * k + 3) for k in (i, j))
        J = np.zeros((3 * self._count, 3))
        J[first] += A.T
        J[second] += B.T
        solved = self.factor.solve(J)
        P: Array = A @ solved[first] + B @ solved[second]
        return (P + P.T) / 2

    def diagonal(self) -> Array:
        """(N, 3, 3): covariance of each node."""
        tail = [own for _, own in self._tail]
        return np.concatenate([self._diagonal, np.reshape(tail, (-1, 3, 3))])

    @property
    def _diagonal(self) -> Array:
        if self._own is None:
            self._own = self.factor.blocks()
            for k in np.flatnonzero(np.isnan(self._own).any(axis=(1, 2))).tolist():
                self._own[k] = self.factor.columns(3 * k, 3)[3 * k : 3 * k + 3]
        return self._own

    def _column(self, j: int) -> Array:
        """(3 N, 3) covariances of all nodes with one. Who asks for one after the other is given some at once."""
        if j not in self._columns:
            if len(self._columns) * 3 * self._count > _KEPT:
                self._columns.clear()
            nodes = min(_AHEAD if j - 1 in self._columns else 1, self._count - j)
            for k, columns in enumerate(np.split(self.factor.columns(3 * j, 3 * nodes), nodes, axis=1), j):
                self._columns[k] = columns
        return self._columns[j]


@kernel
def _size(P: Array) -> float:
    """Trace of a covariance (3, 3)."""
    return P[0, 0] + P[1, 1] + P[2, 2]
