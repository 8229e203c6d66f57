"""The scatter of corners and walls that stand still against the ellipses methods claim for them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.special import chdtri

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import GATES
from lidarcore.evaluation.intervals import LEVEL, intervals, shares, wilson
from lidarcore.evaluation.repeatability.observations import Observations, covariances, root_det
from lidarcore.evaluation.repeatability.summary import FeatureClaim, FeatureScatter, Judgement, Matrix
from lidarcore.geometry import squared_mahalanobis_2d

LEAST = 10
"""A corner or wall seen fewer times is not judged."""

Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Scatter:
    """Figures of K features and M methods; claims of both KINDS.

    ids (K,); counts (K, M); means (K, M, OBSERVATION) of positions and covariances; squares (K, M, 3) the sums of xx,
    xy and yy about the mean; hits (K, M, 2, 3) residuals within the ellipses of GATES; scan_hits (N, M, 2, 3) and
    scan_counts (N, M) hits and counts of each scan.
    """

    ids: Ints
    counts: Array
    means: Array
    squares: Array
    hits: Array
    scan_hits: Array
    scan_counts: Array

    @property
    def is_judged(self) -> bool:
        """Whether any feature was seen often enough."""
        return bool((self.counts >= LEAST).any())

    @cached_property
    def actual(self) -> Array:
        """(K, M) root(det) of the covariance of the scatter, without bias.

        With A the sum of squares about the mean, 2 root(det A / det C) is chi-square with 2 n - 4 degrees of freedom
        (Wishart in the plane with n - 1 of them): root(det A) / (n - 2) has the mean root(det C).
        """
        xx, xy, yy = np.moveaxis(self.squares, -1, 0)
        return np.sqrt(np.maximum(xx * yy - xy * xy, 0.0)) / np.maximum(self.counts - 2, 1)

    @cached_property
    def claimed(self) -> Array:
        """(K, M, kinds) root(det) of the mean claimed covariance."""
        return root_det(covariances(self.means))

    def features(self) -> list[tuple[FeatureScatter, ...]]:
        """The features that each method saw often enough, in the order of their ids."""
        method, good = np.nonzero(self.counts.T >= LEAST)
        at = good, method
        n, actual = self.counts[at], self.actual[at]
        x, y = self.means[at][:, :2].T.tolist()
        xx, xy, yy = (self.squares[at] / (n - 1)[:, None]).T.tolist()
        rows = zip(
            self.ids[good].tolist(),
            n.astype(int).tolist(),
            zip(x, y, strict=True),
            _matrices(xx, xy, yy),
            (np.pi * actual).tolist(),
            self._claims(at),
            strict=True,
        )
        features = [FeatureScatter(*row) for row in rows]
        ends = np.cumsum(np.bincount(method, minlength=self.counts.shape[1])).tolist()
        return [tuple(features[begin:end]) for begin, end in pairwise([0, *ends])]

    def _claims(self, at: tuple[Ints, Ints]) -> Iterator[dict[str, FeatureClaim]]:
        n, claimed = self.counts[at], self.claimed[at]  # (G,), (G, kinds)
        ratios = _area_ratios(claimed, self.actual[at][:, None], (2 * n - 4)[:, None])
        shares = self.hits[at] / n[:, None, None]
        covers = np.array([shares, *wilson(shares, n[:, None, None])])  # (3, G, kinds, levels)
        xx, xy, _, yy = covariances(self.means[at]).reshape(-1, 4).T.tolist()
        areas = (np.pi * claimed).ravel().tolist()
        rows = zip(_matrices(xx, xy, yy), areas, _judgements(ratios, covers), strict=True)
        claims = [FeatureClaim(*row) for row in rows]
        return (dict(zip(KINDS, by_kind, strict=True)) for by_kind in _batched(claims, len(KINDS)))

    def judgements(self) -> list[tuple[Judgement, ...]]:
        """All features together, judged by method and kind: the sum of their areas, and the share of all residuals.

        The interval of coverage is made of the scatter between scans, whose errors are independent. That of areas takes
        the scatter for Gaussian and independent from one to another (Satterthwaite for the sum of their areas).
        """
        hits, trials = np.moveaxis(self.scan_hits, 0, -1), np.moveaxis(self.scan_counts, 0, -1)
        covers = shares(hits, trials[:, None, None])  # (3, M, kinds, levels)
        ratios = np.stack([self._ratios(method) for method in range(len(trials))], 1)
        return list(_batched(_judgements(ratios, covers), len(KINDS)))

    def _ratios(self, method: int) -> Array:
        """(3, kinds) claimed over actual area of all features, and the ends of its interval."""
        good = self.counts[:, method] >= LEAST
        actual = self.actual[good, method]
        if not actual.any():
            return np.full((3, len(KINDS)), np.nan)
        dof = 2 * actual.sum() ** 2 / (actual**2 / (self.counts[good, method] - 2)).sum()
        return _area_ratios(self.claimed[good, method].sum(0), actual.sum(), dof)


def _judgements(ratios: Array, covers: Array) -> list[Judgement]:
    """One after another, from figures and the ends of their intervals: ratios (3, ...), covers (3, ..., levels)."""
    figures = np.concatenate([ratios[..., None], covers], -1)
    return [Judgement(*four) for four in _batched(intervals(figures), figures.shape[-1])]


def _matrices(xx: list[float], xy: list[float], yy: list[float]) -> Iterator[Matrix]:
    return (((a, b), (b, c)) for a, b, c in zip(xx, xy, yy, strict=True))


def _batched(items: Iterable[Item], n: int) -> Iterator[tuple[Item, ...]]:
    """So many at a time, as itertools of Python 3.12 has it."""
    return zip(*[iter(items)] * n, strict=True)


_TAILS = ((1 + LEVEL) / 2, (1 - LEVEL) / 2)  # upper ones, of the lower end and of the upper


def scatter(observations: Observations, scans: int) -> Scatter:
    """What `scans` scans say.

    A residual from the mean of n scans has the covariance (1 - 1/n) C, not C: the mean follows each of its own points.
    Divided by that factor, its squared Mahalanobis distance is chi-square as that of a true error is. No law of
    Hotelling's is needed: the claim C is not estimated from the scatter.
    """
    table, starts = np.ascontiguousarray(np.moveaxis(observations.table, 0, -1)), observations.starts
    feature = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(observations.ids)))
    seen: Bools = np.isfinite(table[:, 0])  # (M, R); sums are quickest along the last axis
    counts = _sums(seen.astype(np.float64), starts)
    means = _sums(np.where(seen[:, None], table, 0.0), starts) / np.maximum(counts, 1)[:, None]
    x, y = np.where(seen[:, None], table[:, :2] - means[:, :2, feature], 0.0).swapaxes(0, 1)
    squares = np.stack([x * x, x * y, y * y], 1)
    shrunk = (1 - 1 / np.maximum(counts, LEAST))[:, feature]
    claimed = table[:, 2:].reshape(len(table), len(KINDS), 4, -1)
    nees = _squared_mahalanobis(x[:, None], y[:, None], claimed) / shrunk[:, None]
    judged = seen & (counts >= LEAST)[:, feature]
    hits = _tally(nees, judged, feature, len(starts))
    scan_hits = _tally(nees, judged, observations.scans, scans)
    return Scatter(
        observations.ids[starts],
        counts.T,
        np.moveaxis(means, -1, 0),
        np.moveaxis(_sums(squares, starts), -1, 0),
        hits[..., :-1],
        scan_hits[..., :-1],
        scan_hits[:, :, 0, -1],
    )


def _tally(nees: Array, judged: Bools, groups: Ints, n: int) -> Array:
    """(n, M, 2, 4) of residuals (M, 2, R) in n groups (R,): those within the ellipses of GATES, and all; none else."""
    cells = np.arange(np.prod(nees.shape[:2])).reshape(*nees.shape[:2], 1)
    # Within so many ellipses of 3: the larger ones hold what a smaller one does.
    within = sum((nees <= gate).astype(np.int64) for gate in GATES)
    keys = (groups * cells.size + cells) * (len(GATES) + 2) + np.where(judged[:, None], within + 1, 0)
    shape = (n, *nees.shape[:2], len(GATES) + 2)
    counts = np.bincount(keys.ravel(), minlength=int(np.prod(shape))).reshape(shape)
    return np.cumsum(counts[..., :0:-1], -1).astype(np.float64)


def _area_ratios(claimed: Array, actual: Array, dof: Array) -> Array:
    """(3, ...) claimed over actual area and the ends of its interval; dof times actual over the truth is chi-square."""
    with np.errstate(divide="ignore", invalid="ignore"):  # what does not scatter at all
        over = claimed / actual
    return np.array([over, *(over * chdtri(dof, p) / dof for p in _TAILS)])


def _squared_mahalanobis(x: Array, y: Array, c: Array) -> Array:
    """e^T C^-1 e (..., R) of e = (x, y) (..., R) and C (..., 4, R).

    Infinite, so that no ellipse holds it, where C is NaN or not positive definite.
    """
    xx, xy, _, yy = np.moveaxis(c, -2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(xx * yy > xy * xy, squared_mahalanobis_2d(x, y, xx, xy, yy), np.inf)


def _sums(values: Array, starts: Ints) -> Array:
    """Sums over stretches of the last axis that begin at `starts`."""
    if not len(starts):
        return np.zeros((*values.shape[:-1], 0))
    return np.add.reduceat(values, starts, axis=-1)
