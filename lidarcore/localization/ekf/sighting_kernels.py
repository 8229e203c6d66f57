"""The arithmetic of sightings on plain arrays, compiled: expected, compared, and what they tell [EKF 18-21].

A Gaussian is a mean x (>= n,) and a covariance P (>= n, >= n) of which the first n count; its first three entries
are T_world_sensor. Both are changed in place.
"""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.geometry.kernels import rotated_covariance, squared_mahalanobis_2d, unrotate, wrap


@kernel
def expect(pose: Array, P: Array, xy: Array, cross: Array, own: Array) -> tuple[Array, Array]:
    """Where landmarks xy (L, 2) m appear in the sensor frame (L, 2), and how uncertain that is (L, 2, 2) [EKF 18-20].

    P (>= 3, >= 3) is the covariance of the pose, cross (L, 3, 2) that of pose and landmark, own (L, 2, 2) theirs.
    """
    L = len(xy)
    z, S = np.empty((L, 2)), np.empty((L, 2, 2))
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(L):
        # An error of m - p - R z in world axes is that of the landmark less [1 0 -dy; 0 1 dx] times that of the pose.
        dx, dy, X = xy[i, 0] - pose[0], xy[i, 1] - pose[1], cross[i]
        a = own[i, 0, 0] + P[0, 0] - 2 * dy * P[0, 2] + dy * dy * P[2, 2] - 2 * (X[0, 0] - dy * X[2, 0])
        d = own[i, 1, 1] + P[1, 1] + 2 * dx * P[1, 2] + dx * dx * P[2, 2] - 2 * (X[1, 1] + dx * X[2, 1])
        b = own[i, 0, 1] + P[0, 1] + dx * P[0, 2] - dy * P[1, 2] - dx * dy * P[2, 2]
        b -= X[0, 1] - dy * X[2, 1] + X[1, 0] + dx * X[2, 0]
        z[i, 0], z[i, 1] = unrotate(c, s, dx, dy)
        S[i, 0, 0], S[i, 0, 1], S[i, 1, 1] = rotated_covariance(c, -s, a, b, d)
        S[i, 1, 0] = S[i, 0, 1]
    return z, S


@kernel
def all_squared_distances(xy: Array, noise: Array, z: Array, S: Array) -> Array:
    """Squared Mahalanobis distances (K, L) of sightings xy (K, 2) and landmarks expected at z (L, 2).

    noise (K, 2, 2) and S (L, 2, 2) are their covariances.
    """
    distances = np.empty((len(xy), len(z)))
    for k in range(len(xy)):
        for i in range(len(z)):
            a, b, d = S[i, 0, 0] + noise[k, 0, 0], S[i, 0, 1] + noise[k, 0, 1], S[i, 1, 1] + noise[k, 1, 1]
            u, v = xy[k, 0] - z[i, 0], xy[k, 1] - z[i, 1]
            distances[k, i] = squared_mahalanobis_2d(u, v, a, b, d)
    return distances


@kernel
def within_any(distances: Array, gate: float) -> Ints:
    """Columns (N,) of squared distances (K, L) with one under the gate."""
    within = np.zeros(distances.shape[1], np.bool_)
    for k in range(distances.shape[0]):
        within |= distances[k] <= gate
    return np.flatnonzero(within)


@inlined
def _apart(row: Array, r: int) -> tuple[float, float]:
    """Entries of the landmark, if r >= 0 and it is not given, less those of the pose."""
    if r >= 0:
        return row[r] - row[0], row[r + 1] - row[1]
    return -row[0], -row[1]


@inlined
def _seen(
    c: float, s: float, u: float, v: float, apart: tuple[float, float], turn: float
) -> tuple[float, float]:
    """H times a column: what its entries, apart and of the heading, do to a sighting at (u, v) m, sensor frame."""
    x, y = unrotate(c, s, apart[0], apart[1])
    return x + v * turn, y - u * turn


@kernel
def innovation_covariance(x: Array, P: Array, z: Array, noise: Array, rows: Ints) -> Array:
    """S (2 K, 2 K) of sightings expected at z (K, 2), of landmarks in these rows (K,) of x, or -1 if they are given."""
    K = len(rows)
    S, PHt = np.empty((2 * K, 2 * K)), np.empty((2, len(P)))
    c, s = np.cos(x[2]), np.sin(x[2])
    for k in range(K):
        for other in range(k, K):
            q = rows[other]
            for i in (0, 1, 2, q, q + 1) if q >= 0 else (0, 1, 2, 0, 0):
                PHt[0, i], PHt[1, i] = _seen(c, s, z[k, 0], z[k, 1], _apart(P[i], rows[k]), P[i, 2])
            for a in range(2):
                row = _seen(c, s, z[other, 0], z[other, 1], _apart(PHt[a], q), PHt[a, 2])
                for b in range(2):
                    S[2 * k + a, 2 * other + b] = S[2 * other + b, 2 * k + a] = row[b]
        for a in range(2):
            for b in range(a + 1):
                entry = S[2 * k + b, 2 * k + a] + noise[k, a, b]
                S[2 * k + a, 2 * k + b] = S[2 * k + b, 2 * k + a] = entry
    return S


@kernel
def correct(x: Array, P: Array, n: int, z: Array, innovation: Array, noise: Array, rows: Ints) -> None:
    """Add what sightings expected at z (K, 2) tell, one after the other, all linearised at the state before them.

    innovation (K, 2) and noise (K, 2, 2), sensor frame; the landmarks are in these rows (K,) of x, or -1 if they
    are given. With S = C C^T and W = P H^T C^-T, P - W W^T stays symmetric whatever the rounding [EKF 21].
    """
    c, s = np.cos(x[2]), np.sin(x[2])
    change, W = np.zeros(n), np.empty((2, n))
    for k in range(len(rows)):
        u, v, r = z[k, 0], z[k, 1], rows[k]
        for j in range(n):
            dx, dy = -P[0, j], -P[1, j]
            if r >= 0:
                dx, dy = dx + P[r, j], dy + P[r + 1, j]
            W[0, j], W[1, j] = _seen(c, s, u, v, (dx, dy), P[2, j])
        a, b = _seen(c, s, u, v, _apart(W[0], r), W[0, 2])
        _, d = _seen(c, s, u, v, _apart(W[1], r), W[1, 2])
        known = _seen(c, s, u, v, _apart(change, r), change[2])
        inv_00 = 1 / np.sqrt(a + noise[k, 0, 0])
        C_10 = (b + noise[k, 0, 1]) * inv_00
        inv_11 = 1 / np.sqrt(d + noise[k, 1, 1] - C_10 * C_10)
        first = (innovation[k, 0] - known[0]) * inv_00
        second = (innovation[k, 1] - known[1] - C_10 * first) * inv_11
        for j in range(n):
            W[0, j] *= inv_00
            W[1, j] = (W[1, j] - C_10 * W[0, j]) * inv_11
            change[j] += W[0, j] * first + W[1, j] * second
        for i in range(n):
            p, q = W[0, i], W[1, i]
            for j in range(n):
                P[i, j] -= p * W[0, j] + q * W[1, j]
    for j in range(n):
        x[j] += change[j]
    x[2] = wrap(x[2])
