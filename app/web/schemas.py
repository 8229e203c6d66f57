"""What REST and WebSocket send that is not simply a record of the domain, declared once.

Records (what plays, what is recorded, a landmark) are their own schemas: routes name their dataclasses.
"""

from typing import Annotated, Literal, NotRequired

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema
from typing_extensions import TypedDict

from ..scene.point_colours import ColourScale
from ..sources.timed_scan import Position

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]
_THREE = {"type": "array", "minItems": 3, "maxItems": 3}
# Said by rows that are alike: tuples of tuples are more than some programs understand of JSON schema.
Matrix3 = Annotated[
    tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
    WithJsonSchema(_THREE | {"items": _THREE | {"items": {"type": "number"}}}),
]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]  # of a body: true is none
Row3 = tuple[Number, Number, Number]

MAX_COORDINATE = 1e6  # m, of a pose that is sent: what is seen from there can still be put into a map
MAX_STAMP = 1e12  # s; more is surely another unit
Finite = Annotated[float, Field(allow_inf_nan=False)]
Coordinate = Annotated[Number, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, description="m")]


class Body(BaseModel):
    """What a client sends: a name that is not known is an error."""

    model_config = ConfigDict(extra="forbid")


class StrictBody(Body):
    """What a client sends, with no name that is not known, and no value converted to the type asked for."""

    model_config = ConfigDict(strict=True)


class OdometryPose(Body):
    """T_odom_sensor at a stamp, s on the clock of the scans: for a live sensor, Unix time."""

    stamp: Annotated[Number, Field(ge=-MAX_STAMP, le=MAX_STAMP, description="s")]
    x: Coordinate
    y: Coordinate
    heading: Annotated[Number, Field(description="rad")]


class SegmentJson(TypedDict):
    """A wall segment by one method: line in normal form with its covariance, end points, m and rad, sensor frame."""

    id: int
    alpha: float
    r: float
    start: Pair
    end: Pair
    length: float
    n_points: int
    rms: float
    covariance: Matrix


class MeasuredCornerJson(TypedDict):
    """A corner by one method: `area` m² of its one-sigma ellipse, `angle` rad between its walls, sensor frame."""

    x: float
    y: float
    sigma_x: float
    sigma_y: float
    area: float
    covariance: Matrix
    angle: float


class CornerJson(TypedDict):
    """A corner that lasts from frame to frame, and the numbers of the segments that meet in it."""

    id: int
    segments: tuple[int, int]
    selected: bool
    by_method: dict[str, MeasuredCornerJson]


class RejectionJson(TypedDict):
    kind: str
    reason: str
    message: str
    xy: Pair
    first_beam: int
    last_beam: int


class SummaryJson(TypedDict):
    corners: int
    median_area: float | None


class ClusterJson(TypedDict):
    """A cluster in the sensor frame: `covariance` is of its mean, `scatter` of its members about it, m²."""

    x: float
    y: float
    covariance: Matrix
    scatter: Matrix
    count: int


class PoseJson(TypedDict):
    """T_world_sensor."""

    x: float
    y: float
    heading: float


class InnovationJson(TypedDict):
    """Observed minus expected position of one landmark, sensor frame, m; null until the landmark is in the file."""

    landmark: int | None
    dx: float
    dy: float
    squared_distance: float


class LocalizationJson(TypedDict):
    """Where the sensor is after this scan, and what the filter made of it.

    `velocity` is m/s ahead and rad/s, `sideways` m/s to the left, as the sensor faces: the speed is the hypotenuse of
    `velocity[0]` and `sideways`. Both are null where odometry moves the filter.

    `landmarks` counts those of the map, `tentative` tells where unconfirmed ones are (m, map frame), `observed` counts
    the points seen; `nis` is chi-square distributed with `dof` degrees of freedom, `nis_band` holds 95 % of it; `truth`
    is what a simulator or a reference says, if there is one.
    """

    mode: Literal["localize", "slam"]
    state: Literal["starting", "tracking", "coasting", "lost"]
    message: str | None
    session: int | None
    pose: PoseJson
    covariance: Matrix3
    velocity: Pair | None
    sideways: float | None
    dead_reckoned: PoseJson | None
    truth: tuple[float, float, float | None] | None
    landmarks: int
    confirmed: int
    tentative: list[Pair]
    observed: int
    ambiguous: int
    unmatched: int
    innovations: list[InnovationJson]
    nis: float
    dof: int
    nis_band: Pair


class TimingsJson(TypedDict):
    """Work on this scan by its stages; `extract_us` of all methods together, `age_ms` since its last byte arrived.

    `locate_us` is null where no pose was estimated, or newer scans have been seen since, as in a repeated one.
    """

    extract_us: float
    cluster_us: float
    locate_us: float | None
    draw_us: float
    age_ms: float


class FrameJson(TypedDict):
    """`extent` of what is seen and of the sensor: from and to along x, then along y, m in the world frame.

    `colour_scale` tells what the colours of the points mean, if that is a number;
    `noise_remark` says so if the noise seen in the last scans contradicts the noise that is set.
    """

    sequence: int
    stamp: float
    source: Position
    n_beams: int
    n_valid: int
    completeness: float
    gaps: list[Pair]
    noise_seen: float
    noise_remark: str | None
    fitter: str
    covariance: Literal["consistent", "published", "map"]
    methods: list[str]
    timings: TimingsJson
    extent: Matrix
    colour_scale: ColourScale | None
    rate_hz: float
    dropped: int
    segments: dict[str, list[SegmentJson]]
    corners: list[CornerJson]
    rejections: list[RejectionJson]
    summary: dict[str, SummaryJson]
    clusters: list[ClusterJson] | None
    localization: LocalizationJson | None
    points: NotRequired[list[Pair]]
