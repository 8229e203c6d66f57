"""What the edges of a pose graph say about its poses: their errors, and the normal equations."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.geometry.kernels import unrotate, wrap
from lidarcore.mapping.doubt import compiled_trust


@kernel
def edge_errors(poses: Array, ends: Ints, relatives: Array, informations: Array) -> Array:
    """Squared Mahalanobis distance (E,) of the edges (E, 2), T_i_j (E, 3), from the poses (N, 3)."""
    chi2, e, J, We, WJ = np.empty(len(ends)), np.empty(3), np.zeros((3, 6)), np.empty(3), np.empty((3, 6))
    for k in range(len(ends)):
        chi2[k] = _error(poses[ends[k, 0]], poses[ends[k, 1]], relatives[k], informations[k], e, J, We, WJ)
    return chi2


@kernel
def linearise(
    poses: Array, ends: Ints, relatives: Array, informations: Array, doubts: Array, blocks: Array, b: Array
) -> float:
    """Blocks (E, 6, 6) of the information, by both ends of each edge; adds to the gradient b (3 N,).

    Returns chi-square. An edge counts less from a chi-square of its doubt (E,) on.
    """
    total, e, J, We, WJ = 0.0, np.empty(3), np.zeros((3, 6)), np.empty(3), np.empty((3, 6))
    for k in range(len(ends)):
        chi2 = _error(poses[ends[k, 0]], poses[ends[k, 1]], relatives[k], informations[k], e, J, We, WJ)
        weight = compiled_trust(chi2, doubts[k])
        total += weight * chi2
        for m in range(6):
            g = J[0, m] * We[0] + J[1, m] * We[1] + J[2, m] * We[2]
            b[3 * ends[k, m // 3] + m % 3] += weight * g
            for n in range(6):
                blocks[k, m, n] = weight * (J[0, m] * WJ[0, n] + J[1, m] * WJ[1, n] + J[2, m] * WJ[2, n])
    return total


@kernel
def _error(a: Array, b: Array, relative: Array, W: Array, e: Array, J: Array, We: Array, WJ: Array) -> float:
    """Pose b seen from a, less what it should be: e (3,), its Jacobian J (3, 6) by a and b, both times W; e W e."""
    c, s = np.cos(a[2]), np.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = unrotate(c, s, dx, dy)
    e[0], e[1] = x - relative[0], y - relative[1]
    e[2] = wrap(b[2] - a[2] - relative[2])
    J[0, 0], J[0, 1], J[0, 2], J[0, 3], J[0, 4] = -c, -s, y, c, s
    J[1, 0], J[1, 1], J[1, 2], J[1, 3], J[1, 4] = s, -c, -x, -s, c
    J[2, 2], J[2, 5] = -1.0, 1.0
    for m in range(3):
        We[m] = W[m, 0] * e[0] + W[m, 1] * e[1] + W[m, 2] * e[2]
        for n in range(6):
            WJ[m, n] = W[m, 0] * J[0, n] + W[m, 1] * J[1, n] + W[m, 2] * J[2, n]
    return float(e[0] * We[0] + e[1] * We[1] + e[2] * We[2])
