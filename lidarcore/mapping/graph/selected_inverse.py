"""Entries of the inverse of a sparse matrix from its factor alone, by Takahashi's recursion [Kaess & Dellaert 2009]."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel


@kernel
def selected_inverse(begins: Ints, rows: Ints, values: Array, pivots: Array, order: Ints) -> Array:
    """Blocks (m / 3, 3, 3) on the diagonal of the inverse of L diag(pivots) L^T, of the m rows of L in this order.

    L comes by columns: rows and values of each from where it begins, first the 1 on the diagonal. A block is NaN if it
    takes entries of the inverse that L has no place for, because they are 0 there.
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
                L[place[rows[e]], k] = values[e]
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
