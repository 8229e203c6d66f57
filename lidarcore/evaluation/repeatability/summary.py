"""What repeatability is told as: plain figures, in m and rad, that `dataclasses.asdict` makes ready for JSON."""

from dataclasses import dataclass

from lidarcore.evaluation.consistency.figures import HONEST, Band, Verdict, within, wrong
from lidarcore.evaluation.intervals import Interval

WHISKER = 1.5  # times the distance between the quartiles
HONEST_50: Band = (0.45, 0.55)  # coverage of a 50 % ellipse that may be true
BELIEVED: Band = (0.90, 0.985)  # of a 95 % ellipse; HONEST is narrower than what a window can show

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]


@dataclass(frozen=True, slots=True)
class Judgement:
    """A claim against the scatter: claimed over actual ellipse area, and how much of the scatter ellipses hold."""

    area_ratio: Interval
    coverage_50: Interval
    coverage_95: Interval
    coverage_99: Interval


def verdict(judgement: Judgement) -> Verdict | None:
    """Wrong if the 95 % ellipses surely are, or those of 50 %; true if those of 95 % surely are near it; else open.

    Open, too, if the two are wrong in opposite ways (`has_other_tails`).

    With few sightings only the 50 % ellipses can tell that ellipses are too large: those of 95 % miss 5 in 100 at best.
    None where nothing is known. A study's `consistency.verdicts.verdict` asks for more, as it has more trials.
    """
    held = judgement.coverage_95
    if held.value != held.value:
        return None
    if has_other_tails(judgement):
        return "open"
    found = wrong(held, HONEST) or wrong(judgement.coverage_50, HONEST_50)
    return found or ("true" if within(held, BELIEVED) else "open")


def has_other_tails(judgement: Judgement) -> bool:
    """Whether ellipses of 50 % are surely too large where those of 95 % are too small, or the other way around.

    No size makes both true: the tails of what scatters are not those of a Gaussian.
    """
    inner, outer = wrong(judgement.coverage_50, HONEST_50), wrong(judgement.coverage_95, HONEST)
    return inner is not None and outer is not None and inner != outer


@dataclass(frozen=True, slots=True)
class FeatureClaim:
    """covariance, the mean of those claimed; area, of its one-sigma ellipse."""

    covariance: Matrix
    area: float
    judgement: Judgement


@dataclass(frozen=True, slots=True)
class FeatureScatter:
    """One corner (x, y; m) or wall (alpha, r; rad and m) by one method, sensor frame. claims by the kind of covariance.

    count    scans it was seen in
    mean     of its two coordinates; the mean alpha of a wall may lie beyond ± pi, where its sightings do
    scatter  the sample covariance
    area     of the one-sigma ellipse of the scatter; without bias, unlike that of the sample covariance
    """

    id: int
    count: int
    mean: Pair
    scatter: Matrix
    area: float
    claims: dict[str, FeatureClaim]


@dataclass(frozen=True, slots=True)
class Box:
    """A box plot of areas: whiskers end at the last values within WHISKER of the box, as in [WCTLS, Fig. 4]."""

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

    areas     of the one-sigma ellipses, each scan's median over what it saw; None while nothing was found
    verdict   on all ellipses together; open: too few sightings to tell; None: nothing is judged
    """

    areas: Box | None
    judgement: Judgement
    verdict: Verdict | None


@dataclass(frozen=True, slots=True)
class Method:
    """One method: claims by the kind of covariance; actual_area is the median over the features judged."""

    name: str
    actual_area: float | None
    claims: dict[str, Claim]


@dataclass(frozen=True, slots=True)
class CornerMethod(Method):
    """What one method makes of the corners; areas in m²."""

    corners: tuple[FeatureScatter, ...]


@dataclass(frozen=True, slots=True)
class WallMethod(Method):
    """What one method makes of the walls; areas in rad m."""

    walls: tuple[FeatureScatter, ...]


@dataclass(frozen=True, slots=True)
class WallSummary:
    """Repeatability of walls; its fields are those of `Summary`, which tells of corners."""

    window: int
    scans: int
    message: str | None
    methods: tuple[WallMethod, ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """What the last `scans` scans say of corners, of at most `window`; message: what is wrong, in plain words.

    walls    the same of walls
    """

    window: int
    scans: int
    message: str | None
    methods: tuple[CornerMethod, ...]
    walls: WallSummary
