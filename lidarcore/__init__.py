"""2D lidar scans to wall segments, corners and their honest covariances.

Metres, radians, seconds; x forward, y left, angles counter-clockwise (REP-103).
"""

from importlib import import_module
from importlib.metadata import version
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
from lidarcore.features import Corners, Features, Segments
from lidarcore.lines import FITTERS, Line, Lines
from lidarcore.noise import SensorNoise
from lidarcore.recordings import open_recording
from lidarcore.rejections import Rejection
from lidarcore.scan import Scan
from lidarcore.sensors import SENSORS, SensorKind
from lidarcore.settings import ExtractionSettings
from lidarcore.tracking import CornerRow, Tracker

if TYPE_CHECKING:
    from lidarcore.client import Client
    from lidarcore.evaluation.calibration.calibrate import calibrate
    from lidarcore.localization import Navigator
    from lidarcore.mapping import Mapper
    from lidarcore.rplidar import Driver

__version__: str

__all__ = [
    "FITTERS",
    "SENSORS",
    "Array",
    "Client",
    "CornerRow",
    "Corners",
    "DegenerateLineError",
    "DeviceError",
    "Driver",
    "ExtractionSettings",
    "Features",
    "Ints",
    "LidarError",
    "Line",
    "Lines",
    "Mapper",
    "Navigator",
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
    "calibrate",
    "compare",
    "errors",
    "extract",
    "files",
    "noise",
    "open_recording",
    "threads",
    "warm_up",
]


_ON_DEMAND = {
    "Client": "lidarcore.client",
    "Driver": "lidarcore.rplidar",
    "Mapper": "lidarcore.mapping",
    "Navigator": "lidarcore.localization",
    "calibrate": "lidarcore.evaluation.calibration.calibrate",
}


def __getattr__(name: str) -> Any:
    """What not all need, on demand: importing lidarcore loads neither HTTP nor filters nor maps."""
    if name == "__version__":
        return version("lidarcore")
    if name not in _ON_DEMAND:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_ON_DEMAND[name]), name)
