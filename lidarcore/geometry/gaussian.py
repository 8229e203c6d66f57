"""Gaussians: Mahalanobis distance, ellipse, containment, fusion. All broadcast over leading axes."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Bools, Numbers
from lidarcore.errors import CovarianceError
from lidarcore.geometry.se2 import unit_vectors


def squared_mahalanobis(difference: Array, covariance: Array) -> Array:
    """e^T C^-1 e (...,) of differences (..., n) with covariances (..., n, n)."""
    solved = np.linalg.solve(covariance, difference[..., None])[..., 0]
    return (difference * solved).sum(-1)


def squared_mahalanobis_2d(u: Numbers, v: Numbers, xx: Numbers, xy: Numbers, yy: Numbers) -> Numbers:
    """e^T C^-1 e (...,) of differences (u, v) with covariances [xx xy; xy yy]; kernels compile this very function."""
    return (yy * u * u - 2 * xy * u * v + xx * v * v) / (xx * yy - xy * xy)


def rotated_covariance(
    c: Numbers, s: Numbers, xx: Numbers, xy: Numbers, yy: Numbers
) -> tuple[Numbers, Numbers, Numbers]:
    """Entries xx, xy, yy of R C R^T with R of cosine c and sine s; kernels compile this very function."""
    turned_xy = (c * c - s * s) * xy + c * s * (xx - yy)
    return c * c * xx - 2 * c * s * xy + s * s * yy, turned_xy, s * s * xx + 2 * c * s * xy + c * c * yy


@lru_cache
def chi_square_gate(probability: float, dimensions: int = 2) -> float:
    """Squared Mahalanobis distance that this share of a Gaussian's draws stays below."""
    from scipy.special import chdtri  # here: importing it takes as long as half of lidarcore

    return float(chdtri(dimensions, 1 - probability))


def contains(difference: Array, covariance: Array, probability: float) -> Bools:
    """(...,) true where a difference (..., n) lies in the ellipse that holds this share of its Gaussian."""
    gate = chi_square_gate(probability, difference.shape[-1])
    return np.asarray(squared_mahalanobis(difference, covariance) <= gate)


def fuse(means: Array, covariances: Array) -> tuple[Array, Array]:
    """Mean (..., n) and covariance (..., n, n) of K independent estimates (..., K, n), (..., K, n, n) in one."""
    information = np.linalg.inv(covariances)
    covariance: Array = np.linalg.inv(information.sum(-3))
    mean: Array = np.einsum("...ij,...kjl,...kl->...i", covariance, information, means)
    return mean, covariance


def ellipse_axes(covariance: Array, sigmas: float = 1.0) -> tuple[Array, Array]:
    """Half axes (..., 2), minor first, and directions (..., 2, 2) in columns, of covariances (..., 2, 2).

    sigmas is the Mahalanobis distance of the ellipse; a variance that rounding made negative counts as 0.
    """
    variances, directions = np.linalg.eigh(covariance)
    return sigmas * np.sqrt(np.maximum(variances, 0.0)), directions


def ellipse_outline(xy: Array, covariance: Array, sigmas: float, points: int) -> Array:
    """Closed outlines (..., points, 2) of ellipses of covariances (..., 2, 2) around xy (..., 2)."""
    half, directions = ellipse_axes(covariance, sigmas)
    turn = np.linspace(0, 2 * np.pi, points)
    circle = unit_vectors(turn)
    return xy[..., None, :] + circle @ np.swapaxes(directions * half[..., None, :], -1, -2)


def largest_variance(covariance: Array) -> Array:
    """Variance (...,) along the longest axis of covariances (..., 2, 2)."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    return (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)


def check_covariance(matrices: ArrayLike, name: str) -> None:
    """Raise CovarianceError unless the matrices (..., n, n) are finite, symmetric and positive definite."""
    C = np.asarray(matrices, np.float64)
    if not np.isfinite(C).all():
        raise CovarianceError(
            f"{name} is not finite: leave the measurement out, or give its true covariance."
        )
    transposed = np.swapaxes(C, -1, -2)
    if C.size and np.abs(C - transposed).max() > 1e-9 * np.abs(C).max():
        raise CovarianceError(f"{name} is not symmetric: give (C + C^T) / 2.")
    try:
        np.linalg.cholesky(C)
    except np.linalg.LinAlgError as error:
        raise CovarianceError(
            f"{name} is not positive definite: no measurement is exact, so every variance must be above 0."
        ) from error
