"""How uneven walls are, and over which length, from what stays the same in every scan of a sensor at rest."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from lidarcore.arrays import Array, Ints
from lidarcore.evaluation.calibration.profiles import Profile, without_line
from lidarcore.evaluation.intervals import Interval

_LENGTHS = np.geomspace(0.01, 0.25, 25)  # m; what is alike over more is the shape of a wall
_BETWEEN_LENGTHS = float(
    np.log(_LENGTHS[1] / _LENGTHS[0]) / np.sqrt(12)
)  # error of what lies between two of them
_LAGS = np.arange(0.0, 0.33, 0.04)  # m, edges of the bins in which products of two points are averaged
_UNLIKE = 4.0  # times the median wall: a wall that uneven has steps or things on it
_SMOOTH = 1e-6  # m: smaller sizes are none
_DRAWS = 200
_SIZE_PRIOR = (0.004, 2.0)  # m, and a factor: rooms as they were measured; a few walls are weak witnesses
_LENGTH_PRIOR = (0.10, 1.6)


def unevenness(walls: list[Profile], rng: np.random.Generator) -> tuple[Interval, Interval]:
    """Standard deviation (m) and correlation length (m) of walls about straight lines, with 95 % intervals.

    By moments, since no real wall is an Ornstein-Uhlenbeck process: mean products of residuals from each wall's line,
    at distances up to 0.3 m, against what such a process would leave of itself and of the medians' noise beside a
    fitted line. A wall much more uneven than most has steps or things on it: it is left out. The size is that for the
    length assumed (`usual`). How well both are known comes from drawing such walls anew; the size also from how walls
    differ beyond that, and from how well the length is known. Its interval begins at 0 where the walls may as well be
    straight.
    """
    by_length = _without_unlike([[_Known.of(wall, length) for wall in walls] for length in _LENGTHS])
    length = _length(by_length, rng)
    assumed, error = _drawn_to(length, _LENGTH_PRIOR)
    known = _at(by_length, assumed)
    size = _size_seen(known)
    drawn = [wall.drawn(size, rng) for wall in known]
    sizes = _size(known, drawn)
    if np.quantile(sizes, 0.025) <= 0 or size <= 0:
        most = max(float(np.quantile(sizes, 0.975)), size)
        return Interval(size, 0.0, most), Interval(length.value, _LENGTHS[0], _LENGTHS[-1])
    shorter, longer = (
        max(_size_seen(_at(by_length, assumed * np.exp(by))), _SMOOTH) for by in (-error, error)
    )
    parts = (_log_error(sizes), _between(known, drawn), float(np.log(longer / shorter)) / 2)
    return _around(size, float(np.linalg.norm(parts))), length


def _without_unlike(by_length: list[list["_Known"]]) -> list[list["_Known"]]:
    """The walls for each length, without those much more uneven than most."""
    own = np.array([_size_seen([wall]) for wall in _at(by_length, _LENGTH_PRIOR[0])])
    alike = np.flatnonzero(own <= _UNLIKE * max(float(np.median(own)), _SMOOTH))
    return [[walls[i] for i in alike] for walls in by_length]


def _at(by_length: list[list["_Known"]], length: float) -> list["_Known"]:
    """The walls for the one of _LENGTHS that is nearest."""
    return by_length[int(np.abs(np.log(_LENGTHS / length)).argmin())]


def _length(by_length: list[list["_Known"]], rng: np.random.Generator) -> Interval:
    """By least squares; its error from walls drawn half way to the usual length.

    Drawn where it was found, at an end of what is looked for, no other could be found.
    """
    found = _best(by_length, [wall.seen for wall in by_length[0]])
    value = float(_LENGTHS[found[0]])
    half_way = _at(by_length, float(np.sqrt(value * _LENGTH_PRIOR[0])))
    size = max(_size_seen(half_way), _SMOOTH)
    draws = _LENGTHS[_best(by_length, [wall.drawn(size, rng) for wall in half_way])]
    return _around(value, float(np.hypot(_log_error(draws), _BETWEEN_LENGTHS)))


def _best(by_length: list[list["_Known"]], products: list[Array]) -> Ints:
    """Which of _LENGTHS fits each of D draws best, by their mean products (LAGS, D) of each wall."""
    gained = [_size(walls, products) ** 2 * np.sqrt(_square(walls)) for walls in by_length]
    best: Ints = np.argmax(gained, axis=0)
    return best


def usual(size: Interval, length: Interval) -> tuple[float, float]:
    """Size and length (m) to assume: what few walls say, drawn to what rooms have by how little it is known."""
    return _drawn_to(size, _SIZE_PRIOR)[0], _drawn_to(length, _LENGTH_PRIOR)[0]


def overlooked(size: Interval) -> tuple[float, float]:
    """Size and length (m) to assume where walls may as well be straight, for all that is known.

    The median of what rooms have, of all that is at most the upper end of the interval: a few walls that look straight
    do not say that they are, many that are seen well do.
    """
    value, factor = _SIZE_PRIOR
    below = float(ndtr(np.log(max(size.high, _SMOOTH) / value) / np.log(factor)))
    return float(value * factor ** ndtri(below / 2)), _LENGTH_PRIOR[0]


def _drawn_to(part: Interval, prior: tuple[float, float]) -> tuple[float, float]:
    """The mean of the logarithms of both, the prior (value, factor), weighted by how well each is known; its error."""
    value, factor = prior
    here, there = (2 * 1.96 / np.log(part.high / part.low)) ** 2, 1 / np.log(factor) ** 2
    mean = (here * np.log(part.value) + there * np.log(value)) / (here + there)
    return float(np.exp(mean)), float(1 / np.sqrt(here + there))


def _log_error(draws: Array) -> float:
    """Standard deviation of the logarithm, by quantiles."""
    low, high = np.quantile(draws, [0.16, 0.84])
    return float(np.log(high / low)) / 2


def _around(value: float, error: float) -> Interval:
    return Interval(value, float(value * np.exp(-1.96 * error)), float(value * np.exp(1.96 * error)))


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """A profile of K points, and what an unevenness of one length would leave of it.

    line (K, 2), what a fitted line can be; covariance (K, K) of unevenness of variance 1; pairs (LAGS, K, K), which
    points are how far apart, and their numbers (LAGS,); shape (LAGS,), the mean products that unevenness of variance 1
    leaves beside a line, and noises (LAGS,), what the medians' noise does.
    """

    wall: Profile
    line: Array
    covariance: Array
    pairs: Array
    numbers: Array
    shape: Array
    noises: Array

    @classmethod
    def of(cls, wall: Profile, length: float) -> "_Known":
        n, line, covariance = len(wall.t), wall.line(), wall.covariance(length)
        apart = np.abs(wall.t[:, None] - wall.t)
        lag = np.where(apart == 0, 0, np.searchsorted(_LAGS, apart))
        pairs = (lag == np.arange(len(_LAGS))[:, None, None]).astype(np.float64)
        numbers = pairs.sum((1, 2))
        left = np.eye(n) - line @ line.T
        shape, noises = (
            np.tensordot(pairs, left @ c @ left) / np.maximum(numbers, 1)
            for c in (covariance, np.diag(wall.noise))
        )
        return cls(wall, line, covariance, pairs, numbers, shape, noises)

    @property
    def weighted(self) -> Array:
        """(LAGS,), the shape times the weight of the mean products."""
        return self.shape * self.numbers / len(self.wall.t) ** 2

    @property
    def seen(self) -> Array:
        """(LAGS, 1) mean products of the wall itself."""
        return self.products(self.wall.off[:, None])

    def products(self, off: Array) -> Array:
        """(LAGS, D) mean products of D profiles (K, D) beside their lines, less the noise's."""
        e = without_line(off, self.line)
        sums = (np.tensordot(self.pairs, e, 1) * e).sum(1)
        products: Array = sums / np.maximum(self.numbers, 1)[:, None] - self.noises[:, None]
        return products

    def drawn(self, size: float, rng: np.random.Generator) -> Array:
        """(LAGS, _DRAWS) mean products of as many walls of that size."""
        covariance = size**2 * self.covariance + np.diag(self.wall.noise + 1e-12)
        root = np.linalg.cholesky(covariance)
        return self.products(root @ rng.standard_normal((len(root), _DRAWS)))


def _size(walls: list[_Known], products: list[Array]) -> Array:
    """Sizes (D,) m by least squares of the mean products (LAGS, D) of each wall, weighted by their pairs."""
    along = sum(wall.weighted @ of for wall, of in zip(walls, products, strict=True))
    sizes: Array = np.sqrt(np.maximum(along / _square(walls), 0.0))
    return sizes


def _square(walls: list[_Known]) -> float:
    return sum(float(wall.weighted @ wall.shape) for wall in walls)


def _size_seen(walls: list[_Known]) -> float:
    """Size (m) that the walls themselves show."""
    return float(_size(walls, [wall.seen for wall in walls])[0])


def _between(walls: list[_Known], drawn: list[Array]) -> float:
    """Relative standard error of the size, by how walls differ beyond what chance makes of walls that are alike."""
    own, by_chance = (
        np.array([_size([one], [products]) ** 2 for one, products in zip(walls, of, strict=True)])
        for of in ([wall.seen for wall in walls], drawn)
    )
    share = np.array([float(one.weighted @ one.shape) for one in walls])
    share /= share.sum()
    spread, expected = (
        np.mean(share @ (variances / np.maximum(share @ variances, _SMOOTH**2) - 1) ** 2)
        for variances in (own, by_chance)
    )
    return float(np.sqrt(max(spread - expected, 0.0) * (share @ share))) / 2
