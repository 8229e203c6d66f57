"""The arithmetic of the map of SLAM, compiled: of landmarks in the state, and of those left alone meanwhile.

A Gaussian is a mean x (>= n,) and a covariance P (>= n, >= n) of which the first n count; its first three entries
are T_world_sensor. Both are changed in place.
"""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel


@kernel
def near_pairs(xy: Array, first: Ints, second: Ints, apart: float) -> list[tuple[int, int]]:
    """Pairs of one of the first and one of the second points whose coordinates xy (L, 2) differ by less than apart."""
    pairs = [(0, 0) for _ in range(0)]
    for i in first:
        for j in second:
            if np.abs(xy[i, 0] - xy[j, 0]) < apart and np.abs(xy[i, 1] - xy[j, 1]) < apart:
                pairs.append((i, j))
    return pairs


@kernel
def carry(P: Array, n: int, rows: Ints, moved: Array) -> None:
    """Say the errors of places in these rows (K,) at means that have moved by (K, 2) m.

    An error of the heading turns all places about the origin, each by its distance: with u = (-dy, dx) for a place
    that has moved by (dx, dy), its error is the one it had and u times that of the heading.
    """
    u, w = np.zeros(n), P[2, :n].copy()
    for k in range(len(rows)):
        u[rows[k]], u[rows[k] + 1] = -moved[k, 1], moved[k, 0]
    for i in range(n):
        for j in range(i + 1):
            if u[i] != 0.0 or u[j] != 0.0:
                P[i, j] += u[i] * w[j] + w[i] * u[j] + u[i] * u[j] * w[2]
                P[j, i] = P[i, j]


@kernel
def survey(
    x: Array, P: Array, rows: Ints, slots: Ints, coefficients: Ints,
    left: Array, x_0: Array, base: Array, own_0: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Means (N, 2), covariances with the pose (N, 3, 2) and own (N, 2, 2) of landmarks in the rows (N,) of x.

    Where a row is -1, they are those of slots (N,) in the passive part: x_0 + base^T theta and base^T Phi^T, carried
    from where the landmarks were left (S, 2).
    """
    N, n = len(rows), len(x_0)
    xy, cross, own = np.empty((N, 2)), np.empty((N, 3, 2)), np.empty((N, 2, 2))
    followed = np.zeros((4, n))
    if N and rows.min() < 0:
        for k in range(len(coefficients)):
            r = coefficients[k]
            a, b, c, theta = P[0, r], P[1, r], P[2, r], x[r]
            for j in range(n):
                entry = base[k, j]
                followed[0, j] += a * entry
                followed[1, j] += b * entry
                followed[2, j] += c * entry
                followed[3, j] += theta * entry
    for i in range(N):
        r, s = rows[i], slots[i]
        if r >= 0:
            for a in range(2):
                xy[i, a] = x[r + a]
                for k in range(3):
                    cross[i, k, a] = P[k, r + a]
                for b in range(2):
                    own[i, a, b] = P[r + a, r + b]
        else:
            X = followed[:, 2 * s : 2 * s + 2]
            for a in range(2):
                xy[i, a] = x_0[2 * s + a] + X[3, a]
            u = left[s, 1] - xy[i, 1], xy[i, 0] - left[s, 0]  # as in carry
            for a in range(2):
                for b in range(2):
                    own[i, a, b] = own_0[s, a, b] + u[a] * X[2, b] + X[2, a] * u[b] + u[a] * u[b] * P[2, 2]
                for k in range(3):
                    cross[i, k, a] = X[k, a] + P[k, 2] * u[a]
    return xy, cross, own


@kernel
def subtract_products(blocks: Array, A: Array, B: Array) -> None:
    """Subtract from blocks (n / 2, 2, 2) those on the diagonal of A^T B, A and B (k, n)."""
    for k in range(len(A)):
        for i in range(len(blocks)):
            for a in range(2):
                for b in range(2):
                    blocks[i, a, b] -= A[k, 2 * i + a] * B[k, 2 * i + b]
