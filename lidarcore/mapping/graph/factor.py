"""A sparse factor of the information of many unknowns: solutions, and entries of the covariance that it stands for."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.mapping.graph.selected_inverse import selected_inverse

_LEAST_FILL = "MMD_AT_PLUS_A"  # minimum degree


class Lower(NamedTuple):
    """L diag(pivots) L^T = H (n, n), rows and columns in a new order.

    begins, rows, values  L by columns: first the 1 on the diagonal, then what elimination fills, but for what is 0
    pivots                (n,)
    order                 (m,) the row of L that each of the first m rows of H became
    """

    begins: Ints
    rows: Ints
    values: Array
    pivots: Array
    order: Ints

    @property
    def shape(self) -> tuple[int, int]:
        """(n, n)"""
        return len(self.pivots), len(self.pivots)

    def solve(self, b: Array) -> Array:
        """x (n,) or (n, k), rows in the order of L, where L diag(pivots) L^T x = b."""
        x = b.copy()
        substitute = _substitute_one if b.ndim == 1 else _substitute
        substitute(self.begins, self.rows, self.values, self.pivots, x)
        return x


class Factor:
    """Of a symmetric positive definite matrix H (n, n), of whose unknowns the first m are asked for, or all.

    The others are eliminated, as if their rows had been taken out before: H^-1 is its first m rows and columns here.
    groups (n,), numbered from 0 on: unknowns with the same neighbours, eliminated together; None: each by itself. Where
    it is weighed what fills least each group counts as one, so that elimination comes to large ones later.

    Until entries of it are asked for, SuperLU solves, in half the time. Then it goes: it keeps three times as much.
    """

    def __init__(self, H: csc_array, asked: int | None = None, groups: Ints | None = None) -> None:
        # Of each unknown that is asked for, in SuperLU's matrix.
        self._places = np.arange(H.shape[0])[:asked]
        if groups is not None:
            order = _order(H, groups)
            H, self._places = H[order][:, order], np.argsort(order)[:asked]
        self._found: SuperLU | Lower = _factored(H, _LEAST_FILL if groups is None else "NATURAL")

    def __len__(self) -> int:
        return len(self._places)

    @property
    def lower(self) -> Lower:
        """What the factor consists of."""
        if isinstance(self._found, SuperLU):
            L, U = self._found.L, self._found.U
            order = self._found.perm_r[self._places]  # a view would keep all of SuperLU alive
            self._found = Lower(L.indptr, L.indices, L.data, U.diagonal(), order)
        return self._found

    def solve(self, b: Array) -> Array:
        """x = H^-1 b, both (m,) or (m, k)."""
        found = self._found
        rows = found.order if isinstance(found, Lower) else self._places
        x = np.zeros((found.shape[0], *b.shape[1:]))
        x[rows] = b
        return np.asarray(found.solve(x)[rows])

    def columns(self, first: int, count: int) -> Array:
        """So many columns (m, count) of H^-1, from the first one on."""
        lower = self.lower
        x = np.zeros((len(lower.pivots), count))
        x[lower.order[first : first + count], range(count)] = 1.0
        return np.asarray(lower.solve(x)[lower.order])

    def blocks(self) -> Array:
        """(m / 3, 3, 3) on the diagonal of H^-1, by Takahashi's recursion.

        A block is NaN if it takes entries of the inverse that L has no place for, because they are 0 there.
        """
        return selected_inverse(*self.lower)


def _factored(H: csc_array, order: str) -> SuperLU:
    """Panels smaller than SuperLU's usual ones take a fifth less time for graphs and a tenth less for adjustments."""
    symmetric = {"SymmetricMode": True}
    return splu(H, permc_spec=order, diag_pivot_thresh=0.0, relax=3, panel_size=10, options=symmetric)


def _order(H: csc_array, groups: Ints) -> Ints:
    """(n,) unknowns, group by group, in an order that fills little."""
    of_group = csr_array((np.ones(len(groups)), (np.arange(len(groups)), groups)))
    ties = csc_array(of_group.T @ abs(H) @ of_group)
    ties.data[:] = 1.0
    order = _factored(csc_array(ties + diags_array(ties.sum(axis=0))), _LEAST_FILL).perm_c
    return np.argsort(order[groups], kind="stable")


@kernel
def _substitute(begins: Ints, rows: Ints, values: Array, pivots: Array, x: Array) -> None:
    """Replace x (n, k) by the solution y of L diag(pivots) L^T y = x."""
    for j in range(len(pivots)):
        if (x[j] != 0.0).any():
            for e in range(begins[j] + 1, begins[j + 1]):
                _take(x, rows[e], values[e], j)
    x /= pivots.reshape(-1, 1)
    for j in range(len(pivots) - 1, -1, -1):
        for e in range(begins[j] + 1, begins[j + 1]):
            _take(x, j, values[e], rows[e])


@kernel
def _substitute_one(begins: Ints, rows: Ints, values: Array, pivots: Array, x: Array) -> None:
    """The same for x (n,), in a third of the time."""
    for j in range(len(pivots)):
        known = x[j]
        for e in range(begins[j] + 1, begins[j + 1]):
            x[rows[e]] -= values[e] * known
    for j in range(len(pivots) - 1, -1, -1):
        known = 0.0
        for e in range(begins[j] + 1, begins[j + 1]):
            known += values[e] * x[rows[e]]
        x[j] = x[j] / pivots[j] - known


@inlined
def _take(x: Array, i: int, times: float, j: int) -> None:
    """Take row j from row i so many times."""
    row, other = x[i], x[j]
    for m in range(len(row)):
        row[m] -= times * other[m]
