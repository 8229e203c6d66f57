"""The JSON form of a frame, declared once: what REST and WebSocket send and OpenAPI describes."""

from typing import Literal, NotRequired

from typing_extensions import TypedDict

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]
Kind = Literal["device", "emulator", "recording"]


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


class TimingsJson(TypedDict):
    extract_us: float
    per_method: dict[str, float]
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
    points: NotRequired[list[Pair]]
