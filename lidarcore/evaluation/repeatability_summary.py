"""What repeatability is told as: plain figures, in m and m², that `dataclasses.asdict` makes ready for JSON."""

from dataclasses import dataclass
from typing import Literal

from lidarcore.evaluation.consistency_figures import HONEST
from lidarcore.evaluation.intervals import Interval

WHISKER = 1.5  # times the distance between the quartiles

Verdict = Literal["too small", "true", "too large"]
Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]


@dataclass(frozen=True, slots=True)
class Judgement:
    """A claim against the scatter: claimed over actual ellipse area, and how much of the scatter ellipses hold."""

    area_ratio: Interval
    coverage_50: Interval
    coverage_95: Interval
    coverage_99: Interval


def verdict(coverage: Interval) -> Verdict | None:
    """Of ellipses that should hold 95 %: wrong if the whole interval says so; None where nothing is known."""
    if coverage.high < HONEST[0]:
        return "too small"
    if coverage.low > HONEST[1]:
        return "too large"
    return "true" if coverage.value == coverage.value else None


@dataclass(frozen=True, slots=True)
class CornerClaim:
    """covariance m², the mean of those claimed; area m², of its one-sigma ellipse."""

    covariance: Matrix
    area: float
    judgement: Judgement


@dataclass(frozen=True, slots=True)
class CornerScatter:
    """One corner by one method. claims by the kind of covariance.

    count    scans it was seen in
    mean     m, sensor frame
    scatter  m², the sample covariance
    area     m², of the one-sigma ellipse of the scatter; without bias, unlike that of the sample covariance
    """

    id: int
    count: int
    mean: Pair
    scatter: Matrix
    area: float
    claims: dict[str, CornerClaim]


@dataclass(frozen=True, slots=True)
class Box:
    """A box plot of areas (m²): whiskers end at the last values within WHISKER of the box, as in [WCTLS, Fig. 4]."""

    low: float
    first_quartile: float
    median: float
    third_quartile: float
    high: float
    outliers: tuple[float, ...]
    scans: int


@dataclass(frozen=True, slots=True)
class Claim:
    """What one method says by one kind of covariance, and whether it is so.

    areas     of the one-sigma ellipses, each scan's median over its corners; None while no corner was found
    verdict   on the 95 % ellipses of all corners together; None while no corner is judged
    """

    areas: Box | None
    judgement: Judgement
    verdict: Verdict | None


@dataclass(frozen=True, slots=True)
class Method:
    """One method: claims by the kind of covariance; actual_area (m²) is the median over the corners judged."""

    name: str
    actual_area: float | None
    claims: dict[str, Claim]
    corners: tuple[CornerScatter, ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """What the last `scans` scans say, of at most `window`; message: what is wrong, in plain words."""

    window: int
    scans: int
    message: str | None
    methods: tuple[Method, ...]
