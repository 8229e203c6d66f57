"""Relative poses with covariances: checked, one after another, and between two poses."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.errors import CovarianceError
from lidarcore.localization.motion_kernels import move
from lidarcore.localization.points import check_covariance
from lidarcore.poses import compose, inverse, wrap
from lidarcore.scan import Array

Uncertain = tuple[Array, Array]
"""A pose (3,) and its covariance (3, 3)."""


def as_covariance(values: ArrayLike, name: str) -> Array:
    """The covariance (3, 3) of a pose. Raises CovarianceError if it is none."""
    P = np.array(values, np.float64)
    if P.shape != (3, 3):
        raise CovarianceError(f"{name} has shape {P.shape}: give that of x, y and heading, (3, 3).")
    check_covariance(P, name)
    return P


def chain(first: Uncertain, second: Uncertain) -> Uncertain:
    """T_a_c from T_a_b and T_b_c with independent errors."""
    (a, A), (b, B) = first, second
    end, F, G = move(a, b)
    return end, F @ A @ F.T + G @ B @ G.T


def relative_pose(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Pose b (3,) seen from a (3,), with its Jacobians (3, 3) by a and by b."""
    z, c, s = compose(inverse(a), b), np.cos(a[2]), np.sin(a[2])
    B = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    A = -B
    A[0, 2], A[1, 2] = z[1], -z[0]
    return z, A, B


def squared_distance(a: Array, b: Array, P: Array) -> float:
    """Squared Mahalanobis distance of two poses (3,) whose difference has the covariance P (3, 3)."""
    e = a - b
    e[2] = wrap(e[2])
    return float(e @ np.linalg.solve(P, e))
