"""The JSON form of repeatability: what the library's summary becomes, with null for what cannot be told yet."""

from typing import Literal

from typing_extensions import TypedDict

from lidarcore.evaluation.consistency.figures import Verdict
from lidarcore.evaluation.repeatability.summary import Box

from .schemas import IntervalJson, Matrix, Pair

Kind = Literal["published", "consistent"]


class JudgementJson(TypedDict):
    """A claim against the scatter: claimed over actual ellipse area, and how much of the scatter ellipses hold."""

    area_ratio: IntervalJson
    coverage_50: IntervalJson
    coverage_95: IntervalJson
    coverage_99: IntervalJson


class ClaimJson(TypedDict):
    """`areas` of the one-sigma ellipses, each scan's median over what it saw.

    `verdict` on all ellipses: `open` while too few observations were made to tell, null while nothing is judged.
    """

    areas: Box | None
    judgement: JudgementJson
    verdict: Verdict | None


class FeatureClaimJson(TypedDict):
    """`covariance`, the mean of those claimed; `area` of its one-sigma ellipse."""

    covariance: Matrix
    area: float
    judgement: JudgementJson


class FeatureScatterJson(TypedDict):
    """A corner (x, y; m) or wall (alpha, r; rad and m) by one method, sensor frame, seen in `count` scans.

    `scatter` is the covariance of the two, `area` that of its one-sigma ellipse: m², or rad m of a wall.
    """

    id: int
    count: int
    mean: Pair
    scatter: Matrix
    area: float
    claims: dict[Kind, FeatureClaimJson]


class MethodJson(TypedDict):
    """`actual_area` m² of the one-sigma ellipse of the scatter, the median over the corners judged."""

    name: str
    actual_area: float | None
    claims: dict[Kind, ClaimJson]
    corners: list[FeatureScatterJson]


class WallMethodJson(TypedDict):
    """`actual_area` rad m of the one-sigma ellipse of the scatter, the median over the walls judged."""

    name: str
    actual_area: float | None
    claims: dict[Kind, ClaimJson]
    walls: list[FeatureScatterJson]


class WallRepeatabilityJson(TypedDict):
    """Repeatability of walls, told like that of corners: areas in rad m."""

    window: int
    scans: int
    message: str | None
    methods: list[WallMethodJson]


class RepeatabilityJson(TypedDict):
    """What the last `scans` scans say of corners, of at most `window`; `message` tells what is wrong.

    `running` tells whether scans are added; the ids of corners and walls are not those of a frame.
    """

    running: bool
    window: int
    scans: int
    message: str | None
    methods: list[MethodJson]
    walls: WallRepeatabilityJson


class DeviationsJson(TypedDict):
    """Where each method saw a corner (x, y; m), or a wall (alpha, r; rad and m), from its mean, the oldest first."""

    id: int
    deviations: dict[str, list[Pair]]
