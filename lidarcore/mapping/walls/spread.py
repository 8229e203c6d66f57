"""How keyframes' poses err together: what a map's covariances need to know of them.

A spread takes M (R, 3 K), by which R quantities move with the poses, and gives M Cov(poses) M^T (R, R).
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from lidarcore.arrays import Array
from lidarcore.errors import CovarianceError

Spread = Callable[[csr_array], Array]


def common_spread(covariances: ArrayLike) -> Spread:
    """A spread from covariances (K, 3, 3) of single poses: what moves one keyframe moves all, each by its share.

    That is what drift does to keyframes that see the same wall. Raises CovarianceError.
    """
    C = np.asarray(covariances, np.float64)
    if C.ndim != 3 or C.shape[1:] != (3, 3) or not np.isfinite(C).all():
        raise CovarianceError(f"The covariances have shape {C.shape}: give (K, 3, 3), all finite.")
    roots = _roots(C).reshape(-1, 3)

    def spread(M: csr_array) -> Array:
        moved = M @ roots
        return moved @ moved.T

    return spread


def joint_spread(covariance: ArrayLike) -> Spread:
    """A spread from the covariance (3 K, 3 K) of all poses: exact. Raises CovarianceError."""
    C = np.asarray(covariance, np.float64)
    if C.ndim != 2 or C.shape[0] != C.shape[1] or C.shape[0] % 3 or not np.isfinite(C).all():
        raise CovarianceError(f"The covariance has shape {C.shape}: give (3 K, 3 K), all finite.")

    return partial(spread_by, C)


def spread_by(covariance: NDArray[np.floating], M: csr_array) -> Array:
    """M C M^T (R, R) of a covariance C (N, N), which is symmetric, and a sparse M (R, N)."""
    columns = np.unique(M.indices)
    few = M[:, columns]
    spread: Array = few @ (few @ covariance[np.ix_(columns, columns)]).T
    return spread


def _roots(C: Array) -> Array:
    """Symmetric roots (K, 3, 3): unlike triangular ones, they change little where the covariance does."""
    values, vectors = np.linalg.eigh((C + C.swapaxes(1, 2)) / 2)
    if (values < -1e-9 * np.abs(values).max(initial=1e-30)).any():
        raise CovarianceError(
            "The covariance of a pose is not positive definite: pass covariances as the mapper returns them."
        )
    return (vectors * np.sqrt(np.maximum(values, 0))[:, None]) @ vectors.swapaxes(1, 2)
