"""How uneven walls are, and over which length, from what stays the same in every scan of a sensor at rest."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcore.evaluation.calibration.wall_beams import WallBeams
from lidarcore.evaluation.intervals import Interval
from lidarcore.scan import Array, Ints

PROFILE_BIN = np.radians(0.5)  # of which the median over all scans is one point of a wall's profile
_LEAST_POINTS = 8  # of a profile: a line takes two
_MOST_POINTS = 150
_LENGTHS = np.geomspace(0.01, 0.25, 33)  # m; what is alike over more than the lags is shape, not unevenness
_LAGS = np.arange(0.0, 0.33, 0.04)  # m, edges of the bins in which products of two points are averaged
_GROSS = 3.0  # standard deviations: a point of a profile counts for no more
_UNLIKE = 4.0  # times the median wall: a wall that uneven has steps or things on it
_MEDIAN_NOISE = np.pi / 2  # variance of a median over that of a mean
_DRAWS = 200
_SIZE_PRIOR = (0.004, 2.0)  # m, and a factor: rooms as they were measured; a few walls are weak witnesses
_LENGTH_PRIOR = (0.08, 1.5)
_USUAL = int(np.abs(np.log(_LENGTHS / _LENGTH_PRIOR[0])).argmin())


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """One wall: t (K,) m along it, off (K,) m from its line, noise m² of one such point."""

    t: Array
    off: Array
    noise: float


def profiles(beams: WallBeams, variance: Array) -> Iterator[Profile]:
    """Those of all walls long enough; variance (N,) m² is that of the beams' ranges."""
    for wall in np.unique(beams.wall):
        on = beams[beams.wall == wall]
        v = variance[beams.wall == wall]
        bins = np.unique(np.floor(on.incidence / PROFILE_BIN), return_inverse=True)[1]
        n = np.bincount(bins)
        full = n >= np.median(n) / 2
        c = np.cos(on.incidence)
        t = np.bincount(bins, on.lever) / n
        noise = np.bincount(bins, v * c * c) / n * _MEDIAN_NOISE / n
        off = _medians_of(c * on.error, bins, len(n))
        kept = np.flatnonzero(full)[:: -(-int(full.sum()) // _MOST_POINTS)]
        if len(kept) >= _LEAST_POINTS:
            yield Profile(t[kept], off[kept], float(noise[kept].mean()))


def unevenness(walls: list[Profile], rng: np.random.Generator) -> tuple[Interval, Interval]:
    """Standard deviation (m) and correlation length (m) of walls about straight lines, with 95 % intervals.

    By moments, since no real wall is an Ornstein-Uhlenbeck process: mean products of residuals from each wall's line,
    at distances up to 0.3 m, against what such a process would leave of itself and of the medians' noise beside a
    fitted line. A wall much more uneven than most has steps or things on it: it is left out. How well both are known
    comes from drawing such walls anew, and from how the walls differ; what few walls say is drawn to what rooms have.
    The interval of the first begins at 0 where the walls may as well be straight.
    """
    known = [_Known.of(wall) for wall in walls]
    own = np.array([_size([wall], [wall.seen()], _USUAL) for wall in known])
    alike = own <= _UNLIKE * max(float(np.median(own)), 1e-6)
    known, own = [wall for wall, one in zip(known, alike, strict=True) if one], own[alike]
    seen = [wall.seen() for wall in known]
    size, length = _fitted(known, seen)
    draws = np.array([_fitted(known, wall_draws) for wall_draws in _drawn(known, size, length, rng)])
    if np.quantile(draws[:, 0], 0.025) <= 0 or size <= 0:
        most = float(np.quantile(draws[:, 0], 0.975))
        return Interval(size, 0.0, max(most, size)), Interval(length, _LENGTHS[0], _LENGTHS[-1])
    usual_length, length_error = _pulled(length, float(np.std(np.log(draws[:, 1]))), _LENGTH_PRIOR)
    size = _size(known, seen, _nearest(usual_length))
    between = float(np.std(np.log(np.maximum(own, 1e-5)))) / np.sqrt(max(len(own) - 1, 1))
    size, error = _pulled(size, max(float(np.std(np.log(draws[:, 0]))), between), _SIZE_PRIOR)
    return _around(size, error), _around(usual_length, length_error)


def _pulled(value: float, error: float, prior: tuple[float, float]) -> tuple[float, float]:
    """A value whose logarithm has that standard error, and its own, drawn to what rooms have (value, factor)."""
    usual, factor = prior
    here, there = 1 / max(error, 1e-3) ** 2, 1 / np.log(factor) ** 2
    together = (here * np.log(value) + there * np.log(usual)) / (here + there)
    return float(np.exp(together)), float(1 / np.sqrt(here + there))


def _around(value: float, error: float) -> Interval:
    return Interval(value, float(value * np.exp(-1.96 * error)), float(value * np.exp(1.96 * error)))


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """A profile of K points with what does not change: lag bin of each pair, and for each of _LENGTHS the mean products
    (LAGS,) that unevenness of variance 1 leaves beside a fitted line, and what the medians' noise does."""

    t: Array
    off: Array
    noise: float
    line: Array
    lag: Ints
    pairs: Array
    shapes: Array
    noises: Array

    @classmethod
    def of(cls, wall: Profile) -> "_Known":
        n = len(wall.t)
        basis = np.linalg.qr(np.column_stack([np.ones(n), wall.t - wall.t.mean()]))[0]
        apart = np.abs(wall.t[:, None] - wall.t)
        lag = np.where(apart == 0, 0, np.searchsorted(_LAGS, apart)).astype(np.int64).ravel()
        pairs = np.bincount(lag, minlength=len(_LAGS) + 1)[: len(_LAGS)].astype(np.float64)
        left = np.eye(n) - basis @ basis.T
        shapes = np.array([_mean_products(left @ np.exp(-apart / L) @ left, lag, pairs) for L in _LENGTHS])
        return cls(
            wall.t,
            wall.off,
            wall.noise,
            basis,
            lag,
            pairs,
            shapes,
            wall.noise * _mean_products(left, lag, pairs),
        )

    def residuals(self, off: Array) -> Array:
        """From the line, what is gross cut down."""
        e: Array = off - self.line @ (self.line.T @ off)
        most = _GROSS * 1.4826 * np.median(np.abs(e))
        return np.clip(e, -most, most) if most > 0 else e

    def seen(self) -> Array:
        """Those of the profile itself."""
        return self.products(self.residuals(self.off))

    def products(self, residuals: Array) -> Array:
        """(LAGS,) mean products; the first of each point with itself."""
        return _mean_products(np.outer(residuals, residuals), self.lag, self.pairs)


def _mean_products(products: Array, lag: Ints, pairs: Array) -> Array:
    sums = np.bincount(lag, products.ravel(), len(pairs) + 1)[: len(pairs)]
    means: Array = sums / np.maximum(pairs, 1)
    return means


def _nearest(length: float) -> int:
    return int(np.abs(np.log(_LENGTHS / length)).argmin())


def _fitted(walls: list["_Known"], products: list[Array]) -> tuple[float, float]:
    """Size and length by least squares of mean products, every wall alike, each lag weighted by its pairs."""
    misfits = [_misfit(walls, products, k, _size(walls, products, k)) for k in range(len(_LENGTHS))]
    best = int(np.argmin(misfits))
    return _size(walls, products, best), float(_LENGTHS[best])


def _size(walls: list["_Known"], products: list[Array], k: int) -> float:
    """The same of the size alone, for the length _LENGTHS[k]."""
    shape, seen, weight = _rows(walls, products, k)
    return float(np.sqrt(max(float((weight * shape) @ seen / ((weight * shape) @ shape)), 0.0)))


def _misfit(walls: list["_Known"], products: list[Array], k: int, size: float) -> float:
    shape, seen, weight = _rows(walls, products, k)
    return float(weight @ (seen - size**2 * shape) ** 2)


def _rows(walls: list["_Known"], products: list[Array], k: int) -> tuple[Array, Array, Array]:
    return (
        np.concatenate([wall.shapes[k] for wall in walls]),
        np.concatenate([p - wall.noises for p, wall in zip(products, walls, strict=True)]),
        np.concatenate([wall.pairs / len(wall.t) ** 2 for wall in walls]),
    )


def _drawn(
    walls: list[_Known], size: float, length: float, rng: np.random.Generator
) -> Iterator[list[Array]]:
    """The products of as many walls of that size and length, again and again."""
    roots = []
    for wall in walls:
        apart = np.abs(wall.t[:, None] - wall.t)
        covariance = size**2 * np.exp(-apart / length) + wall.noise * np.eye(len(wall.t))
        roots.append(np.linalg.cholesky(covariance + 1e-12 * np.eye(len(wall.t))))
    for _ in range(_DRAWS):
        yield [
            wall.products(wall.residuals(root @ rng.standard_normal(len(wall.t))))
            for wall, root in zip(walls, roots, strict=True)
        ]


def _medians_of(values: Array, bins: Ints, count: int) -> Array:
    order = np.lexsort((values, bins))
    n = np.bincount(bins, minlength=count)
    start = np.cumsum(n) - n
    medians: Array = (values[order][start + (n - 1) // 2] + values[order][start + n // 2]) / 2
    return medians
