"""Two variances told apart by a lever: what part of a scatter does not grow with it, and what part does."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtrc, ndtri

from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.scan import Array

_Z = float(ndtri((1 + LEVEL) / 2))
_STEPS = 100


@dataclass(frozen=True, slots=True)
class Bands:
    """Standard deviations in K bands of some quantity, and the one that the lever multiplies.

    edges (K + 1,); sigmas, one for each band; slope, common to all; p_value of the bands being the same: small where
    the data show that they are not.
    """

    edges: tuple[float, ...]
    sigmas: tuple[Interval, ...]
    slope: Interval
    p_value: float


def variance_model(variances: Array, dof: Array, lever2: Array, by: Array, bands: int) -> Bands:
    """Fit v = sigma_band² + lever² slope² to sample variances (M,) with `dof` (M,) degrees of freedom.

    lever2 (M,) is the square of the lever; `by` (M,) the quantity that is cut in bands with as many degrees of freedom
    each. Maximum likelihood for Gaussian errors; the intervals hold for others, too (sandwich covariance).
    """
    edges = _quantiles(by, dof, bands)
    band = np.clip(np.searchsorted(edges, by, side="right") - 1, 0, bands - 1)
    X = np.column_stack([np.eye(bands)[band], lever2])
    beta = _maximum_likelihood(X, variances, dof)
    covariance = _sandwich(X, variances, dof, beta)
    *sigmas, slope = (_root(b, v) for b, v in zip(beta, np.diag(covariance), strict=True))
    return Bands(tuple(edges.tolist()), tuple(sigmas), slope, _same(beta[:-1], covariance[:-1, :-1]))


def _quantiles(by: Array, weights: Array, bands: int) -> Array:
    order = np.argsort(by)
    share = np.cumsum(weights[order]) / weights.sum()
    edges: Array = by[order][np.searchsorted(share, np.linspace(0, 1, bands + 1)).clip(max=len(by) - 1)]
    return edges


def _maximum_likelihood(X: Array, variances: Array, dof: Array) -> Array:
    """Coefficients >= 0, by least squares with weights dof / (2 v²), v from the step before."""
    v = np.full(len(dof), float(np.average(variances, weights=dof)))
    beta = np.zeros(X.shape[1])
    for _ in range(_STEPS):
        root = np.sqrt(dof / 2) / v
        before, (beta, _) = beta, nnls(X * root[:, None] / root.max(), variances * root / root.max())
        v = np.maximum(X @ beta, 1e-6 * v.max())
        if np.allclose(beta, before, rtol=1e-9, atol=0):
            break
    return beta


def _sandwich(X: Array, variances: Array, dof: Array, beta: Array) -> Array:
    weight = dof / (2 * np.maximum(X @ beta, 1e-300) ** 2)
    bread = np.linalg.inv(X.T @ (weight[:, None] * X))
    score = (weight * (variances - X @ beta))[:, None] * X
    covariance: Array = bread @ (score.T @ score) @ bread
    return covariance


def _root(value: float, variance: float) -> Interval:
    half = _Z * float(np.sqrt(variance))
    return Interval(float(value), float(value) - half, float(value) + half).root()


def _same(beta: Array, covariance: Array) -> float:
    """Wald's test: p-value of all entries being equal."""
    if len(beta) < 2:
        return 1.0
    D = np.diff(np.eye(len(beta)), axis=0)
    difference = D @ beta
    return float(chdtrc(len(D), difference @ np.linalg.solve(D @ covariance @ D.T, difference)))
