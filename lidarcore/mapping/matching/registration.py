"""Registration of a scan on a map of surface elements: point to line, robust, with a prior [Censi, ICRA 2008]."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined, kernel
from lidarcore.geometry.kernels import rotate, wrap
from lidarcore.mapping.doubt import DOUBTFUL, compiled_trust
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.surfels import Surfels, nearest

_SIDE = 0.8  # cosine of the largest angle between two surfaces that can be the same one
_ROUNDS, _CONVERGED = 25, 1e-4  # m and rad
_SHRINK, _LEAST = 0.7, 1 / 3  # the reach falls by this factor each round, down to this share
# Of what a scan sees across a direction, less of which lies on the map by chance: shifted along corridors of six real
# logs, 88 % of the scans have less on it, and left where they belong, 11 %.
_FOUND = 0.2
_CAUCHY = 4.0  # squared standard deviations at which a distance counts half


class Registration(NamedTuple):
    """How a scan lies on a map.

    pose         (3,) T_map_scan
    information  (3, 3) of the pose, the guess included
    inliers      share of the returns that make patches which lie on the map
    """

    pose: Array
    information: Array
    inliers: float


@kernel
def information_of(covariance: Array) -> Array:
    """Inverse (3, 3) of a covariance."""
    return np.linalg.inv(covariance).astype(np.float64)


def register(
    map: Surfels, scan: Patches, start: Array, guess: Array, prior: Array, reach: float, settled: bool = False
) -> Registration:
    """Gauss-Newton from a start (3,); the guess (3,) takes part with its information prior (3, 3).

    Surfaces are looked for within `reach` m at first, then nearer; only there if the start is where the scan lay
    already, but for what has been mended of it since.
    Where the match disagrees with the guess by more than chance allows (wheels that slip), the guess counts less;
    where the surfaces say nothing (along a corridor), it counts fully. So it does where few of those that would say
    something lie on the map, and the guess leaves open where: along a corridor, some of the doors fit other ones.
    """
    x, H = np.array(start), np.empty((3, 3))
    least = _LEAST * reach
    inliers = _register(map, scan, x, guess, prior, least if settled else reach, least, H)
    x[2] = wrap(x[2])
    return Registration(x, H, inliers)


@kernel
def _register(
    map: Surfels, scan: Patches, x: Array, guess: Array, prior: Array, reach: float, least: float, H: Array
) -> float:
    g, B, share = np.empty(3), np.empty((3, 3)), 0.0
    across, is_open = np.empty((2, 2, 2)), False
    P = np.linalg.inv(prior)[:2, :2].copy()
    for _ in range(_ROUNDS):
        share = linearised(map, scan, x, reach, H, B, g, across)
        _without_pretence(H, B, g)
        weakest = _weakest(across[1])
        if reach == least and weakest @ P @ weakest > least**2 and _is_chance(across, weakest):
            is_open = True
        if is_open:
            _leave_open(H, g, weakest)
        off = guess - x
        off[2] = wrap(off[2])
        weight = compiled_trust(off @ prior @ off, DOUBTFUL)
        H += weight * prior
        step = np.linalg.solve(H, weight * (prior @ off) - g)
        x += step
        if reach == least and np.abs(step).max() < _CONVERGED:
            break
        reach = max(_SHRINK * reach, least)
    return share


@kernel
def linearised(
    map: Surfels, scan: Patches, x: Array, reach: float, H: Array, B: Array, g: Array, across: Array
) -> float:
    """Information H (3, 3) and gradient g (3,) of the distances at a pose x (3,); returns the share of inliers.

    B (3, 3) is the part of H that is nothing but errors of the normals: n n^T is too large by var(n) t t^T.
    across (2, 2, 2) is what those patches that lie on nothing (0), and on the map (1), would say of a place, and do.
    """
    H[:], B[:], g[:], across[:] = 0.0, 0.0, 0.0, 0.0
    c, s = np.cos(x[2]), np.sin(x[2])
    on, all_of_them = 0.0, 0.0
    for i in range(len(scan.means)):
        dx, dy = rotate(c, s, scan.means[i, 0], scan.means[i, 1])
        mx, my = rotate(c, s, scan.normals[i, 0], scan.normals[i, 1])
        all_of_them += scan.counts[i]
        k = nearest(map, x[0] + dx, x[1] + dy, mx, my, reach, _SIDE)
        if scan.counts[i] > 0:
            _add_normal(across[int(k >= 0)], mx, my, 1 / scan.variances[i])
        if k < 0:
            continue
        on += scan.counts[i]
        nx, ny = map.normals[k]
        r = nx * (x[0] + dx - map.means[k, 0]) + ny * (x[1] + dy - map.means[k, 1])
        w = 1 / (scan.variances[i] + map.variances[k] + r * r / _CAUCHY)
        jt, bt = ny * dx - nx * dy, -nx * dx - ny * dy
        _add(H, g, nx, ny, jt, w, r)
        _add(B, g, -ny, nx, -bt, w * map.tilts[k], 0.0)
    return on / max(all_of_them, 1.0)


@inlined
def _add(H: Array, g: Array, a: float, b: float, c: float, w: float, r: float) -> None:
    H[0, 0] += w * a * a
    H[0, 1] += w * a * b
    H[0, 2] += w * a * c
    H[1, 1] += w * b * b
    H[1, 2] += w * b * c
    H[2, 2] += w * c * c
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    g[0] += w * a * r
    g[1] += w * b * r
    g[2] += w * c * r


@inlined
def _add_normal(A: Array, a: float, b: float, w: float) -> None:
    A[0, 0] += w * a * a
    A[0, 1] += w * a * b
    A[1, 1] += w * b * b
    A[1, 0] = A[0, 1]


@kernel
def _weakest(A: Array) -> Array:
    """Direction (2,) of which A (2, 2) says least."""
    strongest = np.arctan2(2 * A[0, 1], A[0, 0] - A[1, 1]) / 2
    return np.array([-np.sin(strongest), np.cos(strongest)])


@kernel
def _is_chance(across: Array, v: Array) -> bool:
    """Whether most of what a scan sees across a direction v (2,) lies on nothing: what does fits by chance."""
    nowhere, there = v @ across[0] @ v, v @ across[1] @ v
    return there < _FOUND * (nowhere + there)


@kernel
def _leave_open(H: Array, g: Array, v: Array) -> None:
    """Let the distances say nothing of where the scan lies along a direction v (2,)."""
    kept = np.eye(3)
    kept[:2, :2] -= np.outer(v, v)
    H[:] = kept @ H @ kept
    g[:] = kept @ g


@kernel
def _without_pretence(H: Array, B: Array, g: Array) -> None:
    """Directions in which H is mostly pretended count less, down to nothing; twice B, as it scatters by as much."""
    scale = np.sqrt(H[0, 0] + H[1, 1] + 1e-12), np.sqrt(H[2, 2] + 1e-12)
    D = np.diag(np.array([1 / scale[0], 1 / scale[0], 1 / scale[1]]))
    values, V = np.linalg.eigh(D @ H @ D)
    pretended = V.T @ (D @ B @ D) @ V
    a, d = V.T @ (D @ g), np.diag(1 / np.diag(D))
    for m in range(3):
        true = max(0.0, 1 - 2 * pretended[m, m] / max(values[m], 1e-12))
        values[m] *= true
        a[m] *= true
    H[:] = d @ (V * values) @ V.T @ d
    g[:] = d @ (V @ a)
