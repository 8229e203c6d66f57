"""The JSON form of repeatability: what the library's summary becomes, with null for what cannot be told yet."""

from typing import Literal

from typing_extensions import TypedDict

from app.wire import Matrix, Pair
from lidarcore.evaluation.consistency_figures import Verdict

Kind = Literal["published", "consistent"]


class IntervalJson(TypedDict):
    """A figure and the ends of its 95 % confidence interval."""

    value: float | None
    low: float | None
    high: float | None


class JudgementJson(TypedDict):
    """A claim against the scatter: claimed over actual ellipse area, and how much of the scatter ellipses hold."""

    area_ratio: IntervalJson
    coverage_50: IntervalJson
    coverage_95: IntervalJson
    coverage_99: IntervalJson


class BoxJson(TypedDict):
    """A box plot of areas, m²: whiskers end at the last values within 1.5 box lengths of the box."""

    low: float
    first_quartile: float
    median: float
    third_quartile: float
    high: float
    outliers: list[float]
    scans: int


class ClaimJson(TypedDict):
    """`areas` of the one-sigma ellipses, each scan's median over its corners.

    `verdict` on the ellipses of all corners: `open` while there are too few sightings to tell, null while no corner is
    judged.
    """

    areas: BoxJson | None
    judgement: JudgementJson
    verdict: Verdict | None


class CornerClaimJson(TypedDict):
    """`covariance` m², the mean of those claimed; `area` m² of its one-sigma ellipse."""

    covariance: Matrix
    area: float
    judgement: JudgementJson


class CornerScatterJson(TypedDict):
    """A corner by one method: `count` scans it was seen in, `mean` m in the sensor frame, `scatter` and `area` m²."""

    id: int
    count: int
    mean: Pair
    scatter: Matrix
    area: float
    claims: dict[Kind, CornerClaimJson]


class MethodJson(TypedDict):
    """`actual_area` m² of the one-sigma ellipse of the scatter, the median over the corners judged."""

    name: str
    actual_area: float | None
    claims: dict[Kind, ClaimJson]
    corners: list[CornerScatterJson]


class RepeatabilityJson(TypedDict):
    """What the last `scans` scans say, of at most `window`; `message` tells what is wrong.

    `running` tells whether scans are added; the ids of corners are not those of a frame.
    """

    running: bool
    window: int
    scans: int
    message: str | None
    methods: list[MethodJson]


class DeviationsJson(TypedDict):
    """Where each method saw a corner in the scans of the window, m from its mean, the oldest first."""

    id: int
    deviations: dict[str, list[Pair]]
