"""2D lidar scans to wall segments, corners and their honest covariances.

Metres, radians, seconds; x forward, y left, angles counter-clockwise (REP-103).
"""

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
from lidarcore.settings import ExtractionSettings

__all__ = [
    "FITTERS",
    "Corners",
    "DegenerateLineError",
    "DeviceError",
    "ExtractionSettings",
    "Features",
    "LidarError",
    "Line",
    "Lines",
    "RecordingError",
    "Rejection",
    "Scan",
    "ScanError",
    "Segments",
    "SensorNoise",
    "TopicError",
    "compare",
    "extract",
    "open_recording",
    "warm_up",
]
