"""Covariances of the nodes of a pose graph from a sparse factor of its information."""

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.geometry import UncertainPose, relative_jacobians
from lidarcore.geometry.kernels import relative_with_covariance

_KEPT = 3_000_000  # rows of three columns each: 72 MB
_AHEAD = 8  # nodes whose columns are solved for together, which takes little more than those of one
_DIGITS = 1e-8  # share of a covariance that is left of it with at least three digits


class Recovery:
    """Blocks (3, 3) of the joint covariance of N nodes, by their information H (3 N, 3 N).

    Single blocks come from three columns at a time [Eustice et al. 2006], those on the diagonal from the entries of
    the factor alone [Kaess & Dellaert 2009]: all columns together would take 72 N² bytes.

    factor  of H
    """

    def __init__(self, factor: SuperLU) -> None:
        self.factor = factor
        self._count = int(factor.shape[0]) // 3  # of the nodes that the factor knows
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
        J = np.zeros((self.factor.shape[0], 3))
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
            self._own = selected_inverse(*self._parts)
            for k in np.flatnonzero(np.isnan(self._own).any(axis=(1, 2))).tolist():
                self._own[k] = self._solved(k, 1)[3 * k : 3 * k + 3]
        return self._own

    def _column(self, j: int) -> Array:
        """(3 N, 3) covariances of all nodes with one. Who asks for one after the other is given some at once."""
        if j not in self._columns:
            if len(self._columns) * self.factor.shape[0] > _KEPT:
                self._columns.clear()
            nodes = min(_AHEAD if j - 1 in self._columns else 1, self._count - j)
            for k, columns in enumerate(np.split(self._solved(j, nodes), nodes, axis=1), j):
                self._columns[k] = columns
        return self._columns[j]

    def _solved(self, j: int, nodes: int) -> Array:
        """(3 N, 3 M) covariances of all nodes with M from node j on."""
        return columns_of_inverse(*self._parts, 3 * j, 3 * nodes)

    @property
    def _parts(self) -> tuple[Ints, Ints, Array, Array, Ints]:
        """The factor, as the kernels take it."""
        L, pivots = self.factor.L, self.factor.U.diagonal()
        return L.indptr, L.indices, L.data, pivots, self.factor.perm_r


@kernel
def _size(P: Array) -> float:
    """Trace of a covariance (3, 3)."""
    return P[0, 0] + P[1, 1] + P[2, 2]


def factor(H: csc_array) -> SuperLU:
    """Factor of a symmetric positive definite matrix, its rows and columns in the same order.

    Panels smaller than SuperLU's usual ones take a fifth less time for graphs and a tenth less for adjustments.
    """
    symmetric = {"SymmetricMode": True}
    return splu(
        H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, relax=3, panel_size=10, options=symmetric
    )


@kernel
def selected_inverse(begins: Ints, rows: Ints, lower: Array, pivots: Array, order: Ints) -> Array:
    """Blocks (N, 3, 3) on the diagonal of the inverse of L diag(pivots) L^T, by Takahashi's recursion.

    begins, rows, lower  L by columns: unit diagonal, and the entries that elimination fills, but for those that are 0
    order                (3 N,) the row of L that each row of the matrix became

    A block is NaN if it takes entries of the inverse that L has no place for, because they are 0 there.
    """
    inverse, place, runs = np.empty(len(rows)), np.full(len(pivots), -1), _alike(begins, rows)
    for first, end in zip(runs[-2::-1], runs[:0:-1]):  # noqa: B905 (compiled code knows no other)
        last = rows[begins[end - 1] : begins[end]]
        others = last[last >= end]
        m, n = len(others), end - first
        place[others], place[first:end] = np.arange(m), np.arange(m, m + n)
        beyond, met = np.empty((m, m)), 0
        for k in range(m):
            for e in range(begins[others[k]], begins[others[k] + 1]):
                if 0 <= place[rows[e]] < m:
                    met += 1
                    beyond[k, place[rows[e]]] = beyond[place[rows[e]], k] = inverse[e]
        L = np.zeros((m + n, n))
        for k in range(n):
            for e in range(begins[first + k], begins[first + k + 1]):
                L[place[rows[e]], k] = lower[e]
        known = 1.0 if met == m * (m + 1) // 2 else np.nan
        back = np.linalg.inv(L[m:])
        moved = L[:m] @ back
        shared = -known * (beyond @ moved)
        own = back.T @ (back / pivots[first:end].reshape(-1, 1)) - moved.T @ shared
        for k in range(n):
            for e in range(begins[first + k], begins[first + k + 1]):
                at = place[rows[e]]
                inverse[e] = shared[at, k] if at < m else own[at - m, k]
        place[last], place[first:end] = -1, -1
    return _blocks(begins, rows, inverse, order)


@kernel
def columns_of_inverse(
    begins: Ints, rows: Ints, lower: Array, pivots: Array, order: Ints, first: int, count: int
) -> Array:
    """So many columns (3 N, count) of the inverse of the same matrix, from the first one on."""
    solved = np.zeros((len(pivots), count))
    for m in range(count):
        solved[order[first + m], m] = 1.0
    for j in range(order[first : first + count].min(), len(pivots)):
        if (solved[j] == 0.0).all():
            continue
        for e in range(begins[j], begins[j + 1]):
            if rows[e] != j:
                _take(solved, rows[e], lower[e], j)
    solved /= pivots.reshape(-1, 1)
    for j in range(len(pivots) - 1, -1, -1):
        for e in range(begins[j], begins[j + 1]):
            if rows[e] != j:
                _take(solved, j, lower[e], rows[e])
    return solved[order]


@inlined
def _take(solved: Array, i: int, times: float, j: int) -> None:
    """Take row j from row i so many times."""
    row, other = solved[i], solved[j]
    for m in range(len(row)):
        row[m] -= times * other[m]


@kernel
def _alike(begins: Ints, rows: Ints) -> Ints:
    """Where runs of columns begin that have the same rows below them, and where the last of these ends."""
    runs, seen = [0], np.full(len(begins) - 1, -1)
    for j in range(1, len(begins) - 1):
        seen[rows[begins[j] : begins[j + 1]]] = j
        before = rows[begins[j - 1] : begins[j]]
        if len(before) != begins[j + 1] - begins[j] + 1 or (seen[before] == j).sum() != len(before) - 1:
            runs.append(j)
    runs.append(len(begins) - 1)
    return np.array(runs)


@kernel
def _blocks(begins: Ints, rows: Ints, inverse: Array, order: Ints) -> Array:
    found = np.empty((len(order) // 3, 3, 3))
    for k in range(len(found)):
        for m in range(3):
            for n in range(m + 1):
                i, j = order[3 * k + m], order[3 * k + n]
                i, j = max(i, j), min(i, j)
                found[k, m, n] = found[k, n, m] = np.nan
                for e in range(begins[j], begins[j + 1]):
                    if rows[e] == i:
                        found[k, m, n] = found[k, n, m] = inverse[e]
    return found
