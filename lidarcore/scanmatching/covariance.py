"""How uncertain the pose of a match is [Censi, "An accurate closed-form estimate of ICP's covariance", ICRA 2007].

The pose minimises a sum over the pairs, so an error of any point moves it by -H^-1 G, with H the second derivative of
the sum by the pose and G that by pose and point. A point of the reference is part of the lines of its neighbours: its
error moves all of them together, which a sum over independent pairs would miss.
"""

import numpy as np

from lidarcore.compiled import kernel
from lidarcore.scan import Array, Ints
from lidarcore.scanmatching.surface import Surface


def match_covariance(
    reference: Surface, scan: Surface, pose: Array, pairs: Ints, rows: Array, prior: Array
) -> Array:
    """Covariance (3, 3) of the pose (3,) with the pairs (N,) and rows (N, 5) of `pair`.

    prior (3, 3) is the information of the guess that took part, so that there is always an answer.
    """
    used = pairs >= 0
    j, G = pairs[used], rows[used, :3] * rows[used, 4:]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    R = np.array([[c, -s], [s, c]])
    arms = scan.points[used] @ R.T
    H = prior + G.T @ rows[used, :3]
    M = prior + _from_reference(reference, j, arms + pose[:2], G)
    M += _from_scan(reference.normals[j] @ R, scan.covariances[used], G)
    return _sandwich(H, M, _pretended(reference, j, arms, rows[used, 4]), prior)


def _from_scan(normals: Array, C: Array, G: Array) -> Array:
    """Covariance (3, 3) of the gradient by the errors of the scan's points."""
    variances = np.einsum("ni,nij,nj->n", normals, C, normals)
    spread: Array = (G * variances[:, None]).T @ G
    return spread


def _from_reference(reference: Surface, j: Ints, points: Array, G: Array) -> Array:
    """Covariance (3, 3) of the gradient by the errors of the reference's points."""
    offset, normal = points - reference.means[j], reference.normals[j]
    along = offset[:, 0] * normal[:, 1] - offset[:, 1] * normal[:, 0]
    shared = np.zeros((len(reference.bearings), 3, 2))
    _share(reference, j, along, G, shared)
    spread: Array = np.einsum("kai,kij,kbj->ab", shared, reference.covariances, shared)
    return spread


@kernel
def _share(reference: Surface, j: Ints, along: Array, G: Array, shared: Array) -> None:
    """What each reference point does to the gradient, through all lines that it is part of."""
    N = len(reference.bearings)
    for i in range(len(j)):
        nx, ny = reference.normals[j[i]]
        first, count = reference.runs[j[i]]
        for m in range(count):
            k = (first + m) % N
            x, y = reference.points[k] - reference.means[j[i]]
            share = 1 / count + along[i] * (ny * x - nx * y) / reference.spreads[j[i]]
            for a in range(3):
                shared[k, a, 0] -= share * G[i, a] * nx
                shared[k, a, 1] -= share * G[i, a] * ny


def _pretended(reference: Surface, j: Ints, arms: Array, weights: Array) -> Array:
    """Information (3, 3) that is nothing but errors of the normals: n n^T is too large by var(n) t t^T on average.

    Along a corridor there is no other, and the match would look certain. Twice the average, as it scatters by as much.
    """
    n, C = reference.normals[j], reference.covariances[j]
    variances = np.einsum("ni,nij,nj->n", n, C, n) / reference.spreads[j]
    t = np.stack([n[:, 1], -n[:, 0], -(n * arms).sum(1)], -1)
    information: Array = 2 * (t * (variances * weights)[:, None]).T @ t
    return information


def _sandwich(H: Array, M: Array, B: Array, prior: Array) -> Array:
    """H^-1 M H^-1, larger where a share of H is pretended (B), but never below what the prior alone gives."""
    L = np.linalg.cholesky(prior)
    whiten = np.linalg.inv(L)
    values, vectors = np.linalg.eigh(whiten @ (H - B) @ whiten.T)
    true = (L @ vectors * np.maximum(values, 1)) @ (L @ vectors).T  # H without B, at least the prior
    unit = np.linalg.inv(np.linalg.cholesky(H))
    values, vectors = np.linalg.eigh(unit @ true @ unit.T)
    root = unit.T @ (vectors / np.sqrt(np.clip(values, 1e-9, 1))) @ vectors.T
    covariance: Array = root @ (unit @ M @ unit.T) @ root.T
    return (covariance + covariance.T) / 2
