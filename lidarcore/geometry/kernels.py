"""SE(2) and Mahalanobis distances for compiled code, on scalars and single poses; laws hold them to the rest."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined, kernel
from lidarcore.geometry import gaussian
from lidarcore.geometry.se2 import wrapped

wrap = inlined(wrapped)
squared_mahalanobis_2d = inlined(gaussian.squared_mahalanobis_2d)
rotated_covariance = inlined(gaussian.rotated_covariance)


@inlined
def rotate(c: float, s: float, x: float, y: float) -> tuple[float, float]:
    """A vector turned by the angle of cosine c and sine s: from frame b to frame a, if that is b's heading in a."""
    return c * x - s * y, s * x + c * y


@inlined
def unrotate(c: float, s: float, x: float, y: float) -> tuple[float, float]:
    """A vector turned back: from frame a to frame b."""
    return c * x + s * y, c * y - s * x


@kernel
def compose_with_jacobians(T_a_b: Array, T_b_c: Array) -> tuple[Array, Array, Array]:
    """T_a_c (3,) of two poses (3,) and its Jacobians (3, 3) by both."""
    c, s = np.cos(T_a_b[2]), np.sin(T_a_b[2])
    x, y = rotate(c, s, T_b_c[0], T_b_c[1])
    F, G = np.eye(3), np.eye(3)
    F[0, 2], F[1, 2] = -y, x
    G[0, 0], G[0, 1], G[1, 0], G[1, 1] = c, -s, s, c
    return np.array([T_a_b[0] + x, T_a_b[1] + y, wrap(T_a_b[2] + T_b_c[2])]), F, G


@kernel
def compose_with_covariance(T_a_b: Array, own: Array, T_b_c: Array, other: Array) -> tuple[Array, Array]:
    """T_a_c (3,) of two poses whose errors are independent, with covariances (3, 3) of both; and its covariance."""
    pose, F, G = compose_with_jacobians(T_a_b, T_b_c)
    return pose, _carried(F, own, F) + _carried(G, other, G)


@inlined
def turned_back(heading: float) -> Array:
    """(3, 3) that takes errors of a pose to the frame of a sensor with this heading: both Jacobians of `relative` at
    the sensor's own pose, but for the sign."""
    c, s = np.cos(heading), np.sin(heading)
    B = np.eye(3)
    B[0, 0], B[0, 1], B[1, 0], B[1, 1] = c, s, -s, c
    return B


@kernel
def relative_with_covariance(
    T_a_b: Array, T_a_c: Array, own: Array, mixed: Array, other: Array
) -> tuple[Array, Array]:
    """T_b_c (3,) and its covariance, of poses (3,) with covariances own and other (3, 3), and mixed between them."""
    B = turned_back(T_a_b[2])
    x, y = unrotate(B[0, 0], B[0, 1], T_a_c[0] - T_a_b[0], T_a_c[1] - T_a_b[1])
    A = -B
    A[0, 2], A[1, 2] = y, -x
    shared = _carried(A, mixed, B)
    P = _carried(A, own, A) + shared + shared.T + _carried(B, other, B)
    return np.array([x, y, wrap(T_a_c[2] - T_a_b[2])]), (P + P.T) / 2


@inlined
def _carried(A: Array, C: Array, B: Array) -> Array:
    """A C B^T of matrices (3, 3)."""
    carried = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    carried[i, j] += A[i, k] * C[k, m] * B[j, m]
    return carried


@kernel
def squared_mahalanobis(difference: Array, covariance: Array) -> float:
    """e^T C^-1 e of e (n,) and C (n, n), by Cholesky; NaN if C is not positive definite."""
    n = len(difference)
    L, y, total = np.empty((n, n)), np.empty(n), 0.0
    for i in range(n):
        for j in range(i + 1):
            entry = covariance[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(entry) if i == j else entry / L[j, j]
        y[i] = difference[i]
        for k in range(i):
            y[i] -= L[i, k] * y[k]
        y[i] /= L[i, i]
        total += y[i] * y[i]
    return total
