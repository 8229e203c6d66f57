"""Profiles of walls: how far their surfaces lie off straight lines, as all scans of a sensor at rest show it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.evaluation.calibration.wall_beams import WallBeams, medians

PROFILE_BIN = np.radians(0.5)  # of which the median over all scans is one point of a wall's profile
_LEAST_POINTS = 8  # of a profile: a line takes two
_MOST_POINTS = 150
_MEDIAN_NOISE = np.pi / 2  # variance of a median over that of a mean
_GROSS = 3.0  # standard deviations: a point of a profile counts for no more


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """One wall: t (K,) m along it, off (K,) m from its line; each such point is made of beams over width (K,) m of it
    and has the noise (K,) m²."""

    t: Array
    off: Array
    width: Array
    noise: Array

    def line(self) -> Array:
        """(K, 2), an orthonormal basis of what a line through the points can be."""
        basis: Array = np.linalg.qr(np.column_stack([np.ones(len(self.t)), self.t - self.t.mean()]))[0]
        return basis

    def covariance(self, length: float) -> Array:
        """(K, K) of means over the points' widths of an Ornstein-Uhlenbeck process of variance 1 and that length (m).

        Of one interval b: 2 (x - 1 + exp(-x)) / x², x = b / length. Of two that do not overlap: that of their middles
        times sinh(x / 2) / (x / 2) for each.
        """
        x = np.maximum(self.width / length, 1e-6)
        shrunk = np.log(-np.expm1(-x) / x) + x / 2
        apart = np.abs(self.t[:, None] - self.t) / length  # no overflow on the diagonal
        covariance: Array = np.exp(np.minimum(shrunk[:, None] + shrunk - apart, 0.0))
        np.fill_diagonal(covariance, np.where(x < 1e-3, 1 - x / 3, 2 * (x + np.expm1(-x)) / x**2))
        return covariance


def profiles(beams: WallBeams, variance: Array) -> Iterator[Profile]:
    """Profiles of all walls that are long enough; variance (N,) m² is that of the beams' ranges."""
    for wall in np.unique(beams.wall):
        on = beams[beams.wall == wall]
        v = variance[beams.wall == wall]
        bins = np.unique(np.floor(on.incidence / PROFILE_BIN), return_inverse=True)[1]
        n = np.bincount(bins)
        full = n >= np.median(n) / 2
        c = np.cos(on.incidence)
        first, last = _ends(on.ranges * np.sin(on.incidence), bins)
        noise = np.bincount(bins, v * c * c) / n * _MEDIAN_NOISE / n
        off = medians(c * on.error, bins)
        kept = np.flatnonzero(full)[:: -(-int(full.sum()) // _MOST_POINTS)]
        if len(kept) >= _LEAST_POINTS:
            t, width = (first + last) / 2, last - first
            yield Profile(t[kept], off[kept], width[kept], noise[kept])


def without_line(off: Array, line: Array) -> Array:
    """Profiles (K, ...) m beside their lines, gross points cut down."""
    e = off - line @ (line.T @ off)
    most = _GROSS * 1.4826 * np.median(np.abs(e), axis=0)
    cut: Array = np.clip(e, -most, most)
    return cut


def _ends(t: Array, bins: Ints) -> tuple[Array, Array]:
    """The first and the last (K,) m of the beams in each bin."""
    order = np.lexsort((t, bins))
    n = np.bincount(bins)
    last = np.cumsum(n) - 1
    return t[order][last - n + 1], t[order][last]
