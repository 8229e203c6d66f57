"""How uneven walls are, and over which length, from what stays the same in every scan of a sensor at rest."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from lidarcore.evaluation.calibration.wall_beams import WallBeams, medians
from lidarcore.evaluation.intervals import Interval
from lidarcore.scan import Array, Ints

PROFILE_BIN = np.radians(0.5)  # of which the median over all scans is one point of a wall's profile
_LEAST_POINTS = 8  # of a profile: a line takes two
_MOST_POINTS = 150
_LENGTHS = np.geomspace(0.01, 0.25, 33)  # m; what is alike over more than the lags is shape, not unevenness
_BETWEEN_LENGTHS = float(
    np.log(_LENGTHS[1] / _LENGTHS[0]) / np.sqrt(12)
)  # error of what lies between two of them
_LAGS = np.arange(0.0, 0.33, 0.04)  # m, edges of the bins in which products of two points are averaged
_GROSS = 3.0  # standard deviations: a point of a profile counts for no more
_UNLIKE = 4.0  # times the median wall: a wall that uneven has steps or things on it
_SMOOTH = 1e-6  # m: smaller sizes are none
_MEDIAN_NOISE = np.pi / 2  # variance of a median over that of a mean
_DRAWS = 200
_SIZE_PRIOR = (0.004, 2.0)  # m, and a factor: rooms as they were measured; a few walls are weak witnesses
_LENGTH_PRIOR = (0.08, 1.5)
_USUAL = int(np.abs(np.log(_LENGTHS / _LENGTH_PRIOR[0])).argmin())


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """One wall: t (K,) m along it, off (K,) m from its line; each such point is made of beams over width (K,) m of it
    and has the noise (K,) m²."""

    t: Array
    off: Array
    width: Array
    noise: Array


def profiles(beams: WallBeams, variance: Array) -> Iterator[Profile]:
    """Profiles of all walls that are long enough; variance (N,) m² is that of the beams' ranges."""
    for wall in np.unique(beams.wall):
        on = beams[beams.wall == wall]
        v = variance[beams.wall == wall]
        bins = np.unique(np.floor(on.incidence / PROFILE_BIN), return_inverse=True)[1]
        n = np.bincount(bins)
        full = n >= np.median(n) / 2
        c = np.cos(on.incidence)
        first, last = _ends(on.lever, bins)
        noise = np.bincount(bins, v * c * c) / n * _MEDIAN_NOISE / n
        off = medians(c * on.error, bins)
        kept = np.flatnonzero(full)[:: -(-int(full.sum()) // _MOST_POINTS)]
        if len(kept) >= _LEAST_POINTS:
            t, width = (first + last) / 2, last - first
            yield Profile(t[kept], off[kept], width[kept], noise[kept])


def unevenness(walls: list[Profile], rng: np.random.Generator) -> tuple[Interval, Interval]:
    """Standard deviation (m) and correlation length (m) of walls about straight lines, with 95 % intervals.

    By moments, since no real wall is an Ornstein-Uhlenbeck process: mean products of residuals from each wall's line,
    at distances up to 0.3 m, against what such a process would leave of itself and of the medians' noise beside a
    fitted line. A wall much more uneven than most has steps or things on it: it is left out. How well both are known
    comes from drawing such walls anew, and from how the walls differ beyond that. The interval of the first begins at
    0 where the walls may as well be straight.
    """
    known = [_Known.of(wall) for wall in walls]
    seen = [one.products(one.wall.off[:, None]) for one in known]
    own = np.array([_sizes(wall, one)[0] for wall, one in zip(known, seen, strict=True)])
    alike = own <= _UNLIKE * max(float(np.median(own)), _SMOOTH)
    known = [wall for wall, kept in zip(known, alike, strict=True) if kept]
    seen = [one for one, kept in zip(seen, alike, strict=True) if kept]
    size, length = (float(one[0]) for one in _fitted(known, seen))
    drawn = _drawn(known, size, length, rng)
    sizes, lengths = _fitted(known, drawn)
    if np.quantile(sizes, 0.025) <= 0 or size <= 0:
        most = max(float(np.quantile(sizes, 0.975)), size)
        return Interval(size, 0.0, most), Interval(length, _LENGTHS[0], _LENGTHS[-1])
    error = np.hypot(_log_error(sizes), _between(known, seen, drawn))
    return _around(size, error), _around(length, np.hypot(_log_error(lengths), _BETWEEN_LENGTHS))


def usual(size: Interval, length: Interval) -> tuple[float, float]:
    """Size and length (m) to reckon with: what few walls say, drawn to what rooms have by how little it is known."""
    return _drawn_to(size, _SIZE_PRIOR), _drawn_to(length, _LENGTH_PRIOR)


def overlooked(size: Interval) -> tuple[float, float]:
    """Size and length (m) to reckon with where walls may as well be straight, for all that is known.

    The median of what rooms have, of all that is at most the upper end of the interval: a few walls that look straight
    do not say that they are, many that are seen well do.
    """
    value, factor = _SIZE_PRIOR
    below = float(ndtr(np.log(max(size.high, _SMOOTH) / value) / np.log(factor)))
    return float(value * factor ** ndtri(below / 2)), _LENGTH_PRIOR[0]


def _drawn_to(part: Interval, prior: tuple[float, float]) -> float:
    """The mean of the logarithms of both, the prior (value, factor), weighted by how well each is known."""
    value, factor = prior
    here, there = (2 * 1.96 / np.log(part.high / part.low)) ** 2, 1 / np.log(factor) ** 2
    return float(np.exp((here * np.log(part.value) + there * np.log(value)) / (here + there)))


def _log_error(draws: Array) -> float:
    """Standard deviation of the logarithm, by quantiles."""
    low, high = np.quantile(draws, [0.16, 0.84])
    return float(np.log(high / low)) / 2


def _around(value: float, error: float) -> Interval:
    return Interval(value, float(value * np.exp(-1.96 * error)), float(value * np.exp(1.96 * error)))


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """A profile of K points with what does not change.

    line (K, 2), what a fitted line can be; pairs (LAGS, K, K), which of them are how far apart, and their numbers
    (LAGS,); shapes (LENGTHS, LAGS), the mean products that unevenness of variance 1 leaves beside a line, and noises
    (LAGS,), what the medians' noise does.
    """

    wall: Profile
    line: Array
    pairs: Array
    numbers: Array
    shapes: Array
    noises: Array

    @classmethod
    def of(cls, wall: Profile) -> "_Known":
        n = len(wall.t)
        basis = np.linalg.qr(np.column_stack([np.ones(n), wall.t - wall.t.mean()]))[0]
        apart = np.abs(wall.t[:, None] - wall.t)
        lag = np.where(apart == 0, 0, np.searchsorted(_LAGS, apart))
        pairs = (lag == np.arange(len(_LAGS))[:, None, None]).astype(np.float64)
        numbers = pairs.sum((1, 2))
        left = np.eye(n) - basis @ basis.T
        covariances = [*(_covariance(wall, length) for length in _LENGTHS), np.diag(wall.noise)]
        means = np.array([np.tensordot(pairs, left @ c @ left) for c in covariances]) / np.maximum(numbers, 1)
        return cls(wall, basis, pairs, numbers, means[:-1], means[-1])

    @property
    def weight(self) -> Array:
        """(LAGS,) of the mean products."""
        return self.numbers / len(self.wall.t) ** 2

    def products(self, off: Array) -> Array:
        """(LAGS, D) mean products of D profiles (K, D) beside their lines, gross ones cut down, less the noise's."""
        e = off - self.line @ (self.line.T @ off)
        most = _GROSS * 1.4826 * np.median(np.abs(e), axis=0)
        e = np.clip(e, -most, most)
        sums = (np.tensordot(self.pairs, e, 1) * e).sum(1)
        products: Array = sums / np.maximum(self.numbers, 1)[:, None] - self.noises[:, None]
        return products


def _covariance(wall: Profile, length: float) -> Array:
    """(K, K) of means over the points' widths of an Ornstein-Uhlenbeck process of variance 1.

    Of one interval b: 2 (x - 1 + exp(-x)) / x², x = b / length. Of two that do not overlap: that of their middles times
    sinh(x / 2) / (x / 2) for each.
    """
    x = np.maximum(wall.width / length, 1e-6)
    shrunk = np.log(-np.expm1(-x) / x) + x / 2
    apart = np.abs(wall.t[:, None] - wall.t) / length  # no overflow on the diagonal
    covariance: Array = np.exp(np.minimum(shrunk[:, None] + shrunk - apart, 0.0))
    np.fill_diagonal(covariance, np.where(x < 1e-3, 1 - x / 3, 2 * (x + np.expm1(-x)) / x**2))
    return covariance


def _fitted(walls: list[_Known], products: list[Array]) -> tuple[Array, Array]:
    """Sizes and lengths (D,) m by least squares of mean products (LAGS, D) of each wall, weighted by their pairs."""
    weight, seen = np.concatenate([wall.weight for wall in walls]), np.concatenate(products)
    shapes = np.concatenate([wall.shapes for wall in walls], axis=1)
    along, square = np.maximum((weight * shapes) @ seen, 0.0), (weight * shapes**2).sum(1)
    best = np.argmax(along**2 / square[:, None], axis=0)
    return np.sqrt(along[best, np.arange(seen.shape[1])] / square[best]), _LENGTHS[best]


def _sizes(wall: _Known, products: Array) -> Array:
    """Sizes (D,) m of one wall for the usual length."""
    shape = wall.shapes[_USUAL] * wall.weight
    sizes: Array = np.sqrt(np.maximum(shape @ products / (shape @ wall.shapes[_USUAL]), 0.0))
    return sizes


def _between(walls: list[_Known], seen: list[Array], drawn: list[Array]) -> float:
    """Relative standard error of the size, by how walls differ beyond what chance makes of walls that are alike."""
    own, by_chance = (
        np.array([_sizes(one, products) ** 2 for one, products in zip(walls, of, strict=True)])
        for of in (seen, drawn)
    )
    share = np.array([one.weight @ one.shapes[_USUAL] ** 2 for one in walls])
    share /= share.sum()
    spread, expected = (
        np.mean(share @ (variances / np.maximum(share @ variances, _SMOOTH**2) - 1) ** 2)
        for variances in (own, by_chance)
    )
    return float(np.sqrt(max(spread - expected, 0.0) * (share @ share))) / 2


def _drawn(walls: list[_Known], size: float, length: float, rng: np.random.Generator) -> list[Array]:
    """The products (LAGS, _DRAWS) of as many walls of that size and length."""
    found = []
    for one in walls:
        covariance = size**2 * _covariance(one.wall, length) + np.diag(one.wall.noise + 1e-12)
        root = np.linalg.cholesky(covariance)
        found.append(one.products(root @ rng.standard_normal((len(root), _DRAWS))))
    return found


def _ends(t: Array, bins: Ints) -> tuple[Array, Array]:
    """The first and the last (K,) m of the beams in each bin."""
    order = np.lexsort((t, bins))
    n = np.bincount(bins)
    last = np.cumsum(n) - 1
    return t[order][last - n + 1], t[order][last]
