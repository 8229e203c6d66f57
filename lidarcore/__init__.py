"""2D lidar scans to wall segments, corners and their honest covariances.

Metres, radians, seconds; x forward, y left, angles counter-clockwise (REP-103).
"""

from typing import TYPE_CHECKING, Any

from lidarcore.arrays import Array, Ints
from lidarcore.errors import (
    DegenerateLineError,
    DeviceError,
    LidarError,
    RecordingError,
    ScanError,
    TopicError,
)
from lidarcore.extraction import compare, extract, warm_up
from lidarcore.features import Corners, Features, Rejection, Segments
from lidarcore.lines import FITTERS, Line, Lines
from lidarcore.noise import SensorNoise
from lidarcore.recordings import open_recording
from lidarcore.scan import Scan
from lidarcore.sensors import SENSORS, SensorKind
from lidarcore.settings import ExtractionSettings
from lidarcore.tracking import CornerRow, Tracker

if TYPE_CHECKING:
    from lidarcore.client import Client

__all__ = [
    "FITTERS",
    "SENSORS",
    "Array",
    "Client",
    "CornerRow",
    "Corners",
    "DegenerateLineError",
    "DeviceError",
    "ExtractionSettings",
    "Features",
    "Ints",
    "LidarError",
    "Line",
    "Lines",
    "RecordingError",
    "Rejection",
    "Scan",
    "ScanError",
    "Segments",
    "SensorKind",
    "SensorNoise",
    "TopicError",
    "Tracker",
    "body_mask",
    "compare",
    "errors",
    "extract",
    "files",
    "noise",
    "open_recording",
    "threads",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    """The client on demand: most who import lidarcore need no HTTP."""
    if name != "Client":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from lidarcore.client import Client

    return Client
