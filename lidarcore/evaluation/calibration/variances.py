"""Variances told apart by what they grow with: what part of a scatter does not, and what parts do."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtrc, ndtri

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.geometry import squared_mahalanobis
from lidarcore.scan import Array

_Z = float(ndtri((1 + LEVEL) / 2))
_STEPS = 300
_HALVINGS = 50
_ARMIJO = 0.1  # of the gain that the slope promises, a step has to make
_ENOUGH = 1e-6  # of log-likelihood to be gained: the maximum is within a thousandth of a standard error
# of the mean variance, in every variance: the likelihood has bounds, and sigma an error below 1e-3
_FLOOR = 1e-6


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


@dataclass(frozen=True, slots=True, eq=False)
class _Sample:
    """Sample variances (M,) with degrees of freedom (M,), and X (M, P): they are about X beta + floor, beta >= 0."""

    X: Array
    variances: Array
    dof: Array
    floor: float

    def expected(self, beta: Array) -> Array:
        return self.X @ beta + self.floor

    def gain(self, v: Array, before: Array) -> float:
        """By how much the log-likelihood of the variances v (M,) is larger than that of others."""
        return float(self.dof @ (np.log(before / v) + self.variances * (1 / before - 1 / v))) / 2


def variance_model(variances: Array, dof: Array, lever2: Array, by: Array, bands: int) -> Bands:
    """Fit v = sigma_band² + lever² slope² to sample variances (M,) with `dof` (M,) degrees of freedom.

    lever2 (M,) is the square of the lever; `by` (M,) the quantity that is cut in bands with as many degrees of freedom
    each. Maximum likelihood for Gaussian errors; the intervals hold for others, too (sandwich covariance). Raises
    EvaluationError if nothing scatters, or if no maximum is found.
    """
    edges = _quantiles(by, dof, bands)
    band = np.clip(np.searchsorted(edges, by, side="right") - 1, 0, bands - 1)
    beta, covariance = _fit(variances, dof, np.column_stack([np.eye(bands)[band], lever2]))
    *sigmas, slope = _roots(beta, covariance)
    return Bands(tuple(edges.tolist()), tuple(sigmas), slope, _same(beta[:-1], covariance[:-1, :-1]))


def variance_parts(variances: Array, dof: Array, X: Array) -> list[Interval]:
    """Fit v = X sigma² to sample variances (M,) with `dof` (M,) degrees of freedom: the P sigmas, X (M, P).

    As `variance_model` does, which has bands for columns, and the lever.
    """
    return _roots(*_fit(variances, dof, X))


def _fit(variances: Array, dof: Array, X: Array) -> tuple[Array, Array]:
    """The likeliest beta (P,), and its covariance (P, P)."""
    mean = float(np.average(variances, weights=dof))
    if not mean > 0:
        raise EvaluationError("The ranges are the same in every scan: there is no noise to be measured.")
    sample = _Sample(X, variances, dof, _FLOOR * mean)
    beta = _maximum_likelihood(sample)
    return beta, _sandwich(sample, beta)


def _quantiles(by: Array, weights: Array, bands: int) -> Array:
    order = np.argsort(by)
    share = np.cumsum(weights[order]) / weights.sum()
    edges: Array = by[order][np.searchsorted(share, np.linspace(0, 1, bands + 1)).clip(max=len(by) - 1)]
    return edges


def _maximum_likelihood(sample: _Sample) -> Array:
    """The best of what is reached from several starts: where the model fits badly there may be several maxima."""
    sizes = [*np.quantile(sample.variances, (0.1, 0.5)), np.mean(sample.variances)]
    per_lever = sample.X[:, -1].mean()
    starts = [
        np.append(np.full(sample.X.shape[1] - 1, (1 - share) * size), share * size / per_lever)
        for size in sizes
        for share in (0.0, 0.5, 1.0)
    ]
    reached = [beta for start in starts if (beta := _ascend(sample, start)) is not None]
    if not reached:
        raise EvaluationError(
            "The noise cannot be determined: no sigma_range and sigma_bearing fit the scatter of the ranges."
        )
    best, *others = reached
    for beta in others:
        if sample.gain(sample.expected(beta), sample.expected(best)) > 0:
            best = beta
    return best


def _ascend(sample: _Sample, beta: Array) -> Array | None:
    """Fisher scoring among beta >= 0, its steps halved until the likelihood grows, so that it cannot run in circles.

    None if it does not arrive.

    A whole step is least squares with weights dof / (2 v²), v from the step before. It lowers a convex form that has
    the slope of the likelihood, so the likelihood grows at its beginning, unless beta is a maximum.
    """
    for _ in range(_STEPS):
        v = sample.expected(beta)
        root = np.sqrt(sample.dof) / v
        root /= root.max()
        step = nnls(sample.X * root[:, None], (sample.variances - sample.floor) * root)[0] - beta
        promised = float((sample.dof * (sample.variances - v) / (2 * v**2)) @ (sample.X @ step))
        if promised <= _ENOUGH:
            return beta
        for _ in range(_HALVINGS):
            if sample.gain(sample.expected(beta + step), v) >= _ARMIJO * promised:
                break
            step, promised = step / 2, promised / 2
        beta = beta + step
    return None


def _sandwich(sample: _Sample, beta: Array) -> Array:
    X, v = sample.X, sample.expected(beta)
    weight = sample.dof / (2 * v**2)
    bread = np.linalg.inv(X.T @ (weight[:, None] * X))
    score = (weight * (sample.variances - v))[:, None] * X
    covariance: Array = bread @ (score.T @ score) @ bread
    return covariance


def _roots(beta: Array, covariance: Array) -> list[Interval]:
    half = _Z * np.sqrt(np.diag(covariance))
    rows = np.column_stack([beta, beta - half, beta + half]).tolist()
    return [Interval(*row).root() for row in rows]


def _same(beta: Array, covariance: Array) -> float:
    """Wald's test: p-value of all entries being equal."""
    if len(beta) < 2:
        return 1.0
    D = np.diff(np.eye(len(beta)), axis=0)
    return float(chdtrc(len(D), squared_mahalanobis(D @ beta, D @ covariance @ D.T)))
