"""How well a figure of a Monte Carlo study is known: 95 % confidence intervals of ratios and of shares."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from lidarcore.arrays import Array

LEVEL = 0.95
_Z = 1.959964  # of a normal, two-sided at LEVEL


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure and the ends of its 95 % confidence interval; NaN where there was nothing to make it of."""

    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the length of the interval; infinite if nothing is known of the error."""
        return (self.high - self.low) / 2

    def contains(self, value: float) -> bool:
        """Whether the study is compatible with this value."""
        return self.low <= value <= self.high

    def text(self, digits: int, factor: float = 1.0) -> str:
        """'1.23 ± 0.04' of an interval around its value, or the value alone if its error is not known."""
        value = f"{factor * self.value:.{digits}f}".replace("-", "−")
        return f"{value} ± {factor * self.half_width:.{digits}f}" if np.isfinite(self.half_width) else value

    def span(self, digits: int, factor: float = 1.0, to: str = "–") -> str:
        """'1.23 (1.19–1.26)': the value and the ends of its interval."""
        value, low, high = (f"{factor * x:.{digits}f}" for x in (self.value, self.low, self.high))
        return f"{value} ({low}{to}{high})"

    def root(self) -> "Interval":
        """The interval of the square root; an end below 0, which chance can make, becomes 0."""
        value, low, high = np.sqrt(np.maximum([self.value, self.low, self.high], 0.0)).tolist()
        return Interval(value, low, high)


UNKNOWN = Interval(np.nan, np.nan, np.nan)


def intervals(told: Array) -> list[Interval]:
    """One after another, of figures and the ends of their intervals (3, ...); all that are not known are UNKNOWN."""
    rows = zip(*told.reshape(3, -1).tolist(), strict=True)
    return [Interval(*row) if row[0] == row[0] else UNKNOWN for row in rows]


def mean(values: ArrayLike) -> Interval:
    """Mean of independent runs (R,), with Student's t; one run says nothing of its error."""
    x = np.asarray(values, np.float64)
    return ratio(x, np.ones(len(x)))


def ratio(numerators: Array, denominators: Array) -> Interval:
    """Sum over sum of independent blocks (B,), by the linearised variance of a ratio and Student's t.

    Trials may depend on each other within a block: corners of one scan share a wall, scans share a place.
    """
    blocks, total = len(numerators), float(denominators.sum())
    if total == 0:
        return UNKNOWN
    value = float(numerators.sum()) / total
    if blocks < 2:
        return Interval(value, -np.inf, np.inf)
    half = float(stdtrit(blocks - 1, (1 + LEVEL) / 2)) * float(
        _standard_error(numerators, denominators, value)
    )
    return Interval(value, value - half, value + half)


def share(hits: Array, trials: Array) -> Interval:
    """The interval of a share of trials, by blocks (B,), as `shares` tells it."""
    (one,) = intervals(shares(hits, trials))
    return one


def shares(hits: Array, trials: Array) -> Array:
    """(3, ...) shares of trials (..., B) and the ends of Wilson's intervals, which stay within 0 and 1.

    Its number of trials is that of independent ones with the scatter between blocks; all of them where the share is
    0 or 1 and nothing scatters. NaN where there are no trials.
    """
    n, blocks = trials.sum(-1), hits.shape[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        p = hits.sum(-1) / n
        variance = _standard_error(hits, trials, p) ** 2 if blocks > 1 else np.zeros_like(p)
        n = np.where(variance > 0, np.minimum(n, p * (1 - p) / variance), n)
        return np.array([p, *wilson(p, n)])


def wilson(p: Array, n: Array) -> tuple[Array, Array]:
    """Ends of Wilson's intervals of shares p of n > 0 independent trials."""
    middle = (p + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
    half = _Z / (1 + _Z**2 / n) * np.sqrt(p * (1 - p) / n + _Z**2 / (4 * n * n))
    return np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)


def _standard_error(numerators: Array, denominators: Array, value: ArrayLike) -> Array:
    """(...) of ratios with that value (...), from blocks (..., B)."""
    blocks = numerators.shape[-1]
    scatter = np.square(numerators - np.expand_dims(value, -1) * denominators).sum(-1)
    return np.sqrt(scatter * blocks / (blocks - 1)) / denominators.sum(-1)
