"""The scatter of corners and walls that stand still against the ellipses methods claim for them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import GATES
from lidarcore.evaluation.intervals import LEVEL, Interval, share, wilson
from lidarcore.evaluation.repeatability.summary import FeatureClaim, FeatureScatter, Judgement
from lidarcore.scan import Array, Ints
from lidarcore.tables import CORNER_CONSISTENT, CORNER_PUBLISHED

LEAST = 10
"""A corner or wall seen fewer times is not judged."""
SIGHTING = 10
"""Numbers of a sighting: x, y of a corner or alpha, r of a wall; published (4), consistent (4)."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """R sightings of features, all corners or all walls, sorted by feature and then by scan.

    ids, scans (R,); table (R, M, SIGHTING) for M methods, NaN where a method did not find the feature.
    """

    ids: Ints
    scans: Ints
    table: Array

    @property
    def starts(self) -> Ints:
        """(K,) where each feature begins."""
        return np.flatnonzero(np.diff(self.ids, prepend=-1))


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Figures of K features and M methods; claims of both KINDS.

    ids (K,); counts (K, M); means (K, M, SIGHTING) of positions and covariances; squares (K, M, 3) the sums of xx, xy
    and yy about the mean; hits (K, M, 2, 3) residuals within the ellipses of GATES; scan_hits (N, M, 2, 3) and
    scan_counts (N, M) the same by scan.
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

    @property
    def actual(self) -> Array:
        """(K, M) root(det) of the covariance of the scatter, without bias.

        With A the sum of squares about the mean, 2 root(det A / det C) is chi-square with 2 n - 4 degrees of freedom
        (Wishart in the plane with n - 1 of them): root(det A) / (n - 2) has the mean root(det C).
        """
        xx, xy, yy = np.moveaxis(self.squares, -1, 0)
        actual: Array = np.sqrt(np.maximum(xx * yy - xy * xy, 0.0)) / np.maximum(self.counts - 2, 1)
        return actual

    def claimed(self, kind: int) -> Array:
        """(K, M) root(det) of the mean claimed covariance."""
        return _root_det(self.means[..., _columns(kind)])

    def features(self, method: int) -> Iterator[FeatureScatter]:
        """Those that the method saw often enough, by their ids."""
        good = np.flatnonzero(self.counts[:, method] >= LEAST)
        n, actual = self.counts[good, method], self.actual[good, method]
        claims = [self._claims(good, method, kind, actual) for kind in range(len(KINDS))]
        rows = zip(
            self.ids[good].tolist(),
            n.astype(int).tolist(),
            self.means[good, method, :2].tolist(),
            (self.squares[good, method] / (n - 1)[:, None]).tolist(),
            (np.pi * actual).tolist(),
            *claims,
            strict=True,
        )
        for number, count, (x, y), (xx, xy, yy), area, *claimed in rows:
            by_kind = dict(zip(KINDS, claimed, strict=True))
            yield FeatureScatter(number, count, (x, y), ((xx, xy), (xy, yy)), area, by_kind)

    def _claims(self, good: Ints, method: int, kind: int, actual: Array) -> list[FeatureClaim]:
        n, claimed = self.counts[good, method], self.claimed(kind)[good, method]
        areas = _area_ratios(claimed, actual, 2 * n - 4)
        shares = self.hits[good, method, kind] / n[:, None]
        covers = np.array([shares, *wilson(shares, n[:, None])])  # (3, G, levels)
        covariances = self.means[good, method, _columns(kind)].tolist()
        return [
            FeatureClaim(
                ((xx, xy), (xy, yy)), area, Judgement(Interval(*area_ratio), *(Interval(*c) for c in cover))
            )
            for (xx, xy, _, yy), area, area_ratio, cover in zip(
                covariances,
                (np.pi * claimed).tolist(),
                areas.T.tolist(),
                covers.transpose(1, 2, 0).tolist(),
                strict=True,
            )
        ]

    def judgement(self, method: int, kind: int) -> Judgement:
        """All features together: the sum of their areas, and the share of all residuals.

        The interval of coverage is made of the scatter between scans, whose errors are independent. That of areas takes
        the scatter for Gaussian and independent from one to another (Satterthwaite for the sum of their areas).
        """
        good = self.counts[:, method] >= LEAST
        actual, claimed = self.actual[good, method], self.claimed(kind)[good, method]
        hits, trials = self.scan_hits[:, method, kind], self.scan_counts[:, method]
        covers = [share(h, trials) for h in hits.T]
        if not actual.any():
            return Judgement(Interval(np.nan, np.nan, np.nan), *covers)
        dof = 2 * actual.sum() ** 2 / (actual**2 / (self.counts[good, method] - 2)).sum()
        return Judgement(Interval(*_area_ratios(claimed.sum(), actual.sum(), dof).tolist()), *covers)


_TAILS = ((1 + LEVEL) / 2, (1 - LEVEL) / 2)  # upper ones, of the lower end and of the upper


def scatter(sightings: Observations, scans: int) -> Scatter:
    """What `scans` scans say.

    A residual from the mean of n scans has the covariance (1 - 1/n) C, not C: the mean follows each of its own points.
    Divided by that factor, its squared Mahalanobis distance is chi-square as that of a true error is. No law of
    Hotelling's is needed: the claim C is not estimated from the scatter.
    """
    table, starts = sightings.table, sightings.starts
    feature = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(table)))
    seen: Mask = np.isfinite(table[..., 0])
    counts = _sums(seen.astype(np.float64), starts)
    means = _sums(np.where(seen[..., None], table, 0.0), starts) / np.maximum(counts, 1)[..., None]
    x, y = np.moveaxis(np.where(seen[..., None], table[..., :2] - means[feature, :, :2], 0.0), -1, 0)
    squares = np.stack([x * x, x * y, y * y], -1)
    judged = seen & (counts >= LEAST)[feature]
    shrunk = (1 - 1 / np.maximum(counts, LEAST))[feature]
    hits = np.zeros((*seen.shape, len(KINDS), len(GATES)))
    for kind in range(len(KINDS)):
        nees = _mahalanobis(squares, table[..., _columns(kind)]) / shrunk
        hits[:, :, kind] = (nees[..., None] <= GATES) & judged[..., None]
    order = np.argsort(sightings.scans, kind="stable")
    at = np.flatnonzero(np.diff(sightings.scans[order], prepend=-1))
    scan_hits, scan_counts = np.zeros((scans, *hits.shape[1:])), np.zeros((scans, seen.shape[1]))
    present = sightings.scans[order][at]
    scan_hits[present], scan_counts[present] = (
        _sums(hits[order], at),
        _sums(judged[order].astype(np.float64), at),
    )
    return Scatter(
        sightings.ids[starts],
        counts,
        means,
        _sums(squares, starts),
        _sums(hits, starts),
        scan_hits,
        scan_counts,
    )


def one_sigma_areas(table: Array) -> Array:
    """(..., 2) areas of the claimed one-sigma ellipses of sightings (..., SIGHTING), by KINDS."""
    return np.stack([np.pi * _root_det(table[..., _columns(kind)]) for kind in range(len(KINDS))], -1)


def _area_ratios(claimed: Array, actual: Array, dof: Array) -> Array:
    """(3, ...) claimed over actual area and the ends of its interval; dof times actual over the truth is chi-square."""
    with np.errstate(divide="ignore", invalid="ignore"):  # what does not scatter at all
        over = claimed / actual
    return np.array([over, *(over * chdtri(dof, p) / dof for p in _TAILS)])


def _columns(kind: int) -> slice:
    start = (CORNER_PUBLISHED, CORNER_CONSISTENT)[kind]
    return slice(start, start + 4)


def _root_det(c: Array) -> Array:
    root: Array = np.sqrt(np.maximum(c[..., 0] * c[..., 3] - c[..., 1] * c[..., 2], 0.0))
    return root


def _mahalanobis(squares: Array, c: Array) -> Array:
    """e^T C^-1 e from the products xx, xy, yy of e; NaN, which no ellipse holds, where C is NaN."""
    xx, xy, yy = np.moveaxis(squares, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return cast(Array, (c[..., 3] * xx - 2 * c[..., 1] * xy + c[..., 0] * yy) / _root_det(c) ** 2)


def _sums(values: Array, starts: Ints) -> Array:
    """Sums over stretches of the first axis that begin at `starts`."""
    if not len(starts):
        return np.zeros((0, *values.shape[1:]))
    return np.add.reduceat(values, starts, axis=0)
