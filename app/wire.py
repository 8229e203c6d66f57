"""The JSON form of a frame, declared once: what REST and WebSocket send and OpenAPI describes."""

from typing import Literal, NotRequired

from typing_extensions import TypedDict

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]
Matrix3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
Kind = Literal["device", "emulator", "simulation", "recording"]


class DeviceJson(TypedDict):
    """A sensor, what it said of itself, and how well its measurements arrive."""

    port: str
    name: str
    serial: str
    firmware: str
    hardware: int
    health: str
    mode: str
    modes: list[str]
    rpm: int
    baud: int
    state: Literal["connecting", "streaming", "stalled", "reconnecting", "closed"]
    error: str | None
    rate_hz: float
    samples_per_s: float
    completeness: float
    bytes: int
    revolutions: int
    reconnects: int
    overruns: int
    dropped: dict[str, int]


class PositionJson(TypedDict):
    kind: Kind
    index: int
    count: int | None
    time: float


class SegmentJson(TypedDict):
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
    x: float
    y: float
    sigma_x: float
    sigma_y: float
    area: float
    covariance: Matrix
    angle: float


class CornerJson(TypedDict):
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

    `landmarks` counts those of the map, `observed` the points seen; `nis` is chi-square distributed with `dof`
    degrees of freedom, `nis_band` holds 95 % of it; `truth` is what a simulator or a reference says, if there is one.
    """

    mode: Literal["localize", "slam"]
    state: Literal["starting", "tracking", "coasting", "lost"]
    message: str | None
    session: int | None
    pose: PoseJson
    covariance: Matrix3
    velocity: Pair | None
    dead_reckoned: PoseJson | None
    truth: tuple[float, float, float | None] | None
    landmarks: int
    confirmed: int
    observed: int
    ambiguous: int
    unmatched: int
    innovations: list[InnovationJson]
    nis: float
    dof: int
    nis_band: Pair


class OdometryStateJson(TypedDict):
    """Odometry sent from outside: poses taken and refused since the last reset, and the newest stamp taken, s.

    `used` tells whether the newest scan was given some; if not, `problem` says why, unless none was sent.
    """

    taken: int
    refused: int
    stamp: float | None
    used: bool
    problem: str | None


class LocalizationStateJson(TypedDict):
    """`session` is built or localized in; `map` was chosen to localize in, null for the newest with landmarks."""

    mode: Literal["off", "localize", "slam"]
    session: int | None
    map: int | None
    problem: str | None
    odometry: OdometryStateJson


class TimingsJson(TypedDict):
    extract_us: float
    per_method: dict[str, float]
    cluster_us: float
    locate_us: float
    draw_us: float
    age_ms: float


class FrameJson(TypedDict):
    sequence: int
    stamp: float
    source: PositionJson
    n_beams: int
    n_valid: int
    completeness: float
    gaps: list[Pair]
    noise_seen: float
    fitter: str
    covariance: Literal["consistent", "published"]
    methods: list[str]
    timings: TimingsJson
    rate_hz: float
    dropped: int
    segments: dict[str, list[SegmentJson]]
    corners: list[CornerJson]
    rejections: list[RejectionJson]
    summary: dict[str, SummaryJson]
    clusters: list[ClusterJson] | None
    localization: LocalizationJson | None
    points: NotRequired[list[Pair]]
