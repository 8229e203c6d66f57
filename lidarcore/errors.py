"""What can go wrong, as types. Every message says what was found and what to do about it."""


class LidarError(Exception):
    """Base of all errors this library raises on purpose."""


class ScanError(LidarError, ValueError):
    """The arrays given do not make a scan: shapes differ, bearings are not finite, nothing in them."""


class DegenerateLineError(LidarError, ValueError):
    """The points do not determine a line, or not one the chosen fitter can express."""


class RecordingError(LidarError):
    """A recording cannot be read: unknown, empty, truncated, hostile, or not a lidar recording."""


class TopicError(RecordingError):
    """The recording holds several lidar topics (or not the one asked for): choose one of `topics`."""

    def __init__(self, message: str, topics: tuple[str, ...]) -> None:
        super().__init__(message)
        self.topics = topics

    def __reduce__(self) -> tuple[type["TopicError"], tuple[str, tuple[str, ...]]]:
        return TopicError, (str(self), self.topics)


class DeviceError(LidarError):
    """The sensor cannot be used; the message names the cause and the cure."""


class NoDeviceError(DeviceError):
    """No sensor was found, or the port named does not exist."""


class PortPermissionError(DeviceError):
    """The user may not open the port."""


class PortBusyError(DeviceError):
    """Another program holds the port."""


class NoAnswerError(DeviceError):
    """Nothing, or nothing that makes sense, came back in time: power, cable, baud rate or another device."""


class ProtectionStopError(DeviceError):
    """The sensor stopped itself for protection, and a reset did not help."""


class UnpluggedError(DeviceError):
    """The port went away while it was in use."""


class LandmarkError(LidarError, ValueError):
    """A landmark, or a question about landmarks, makes no sense: NaN, a covariance that is none, min above max."""


class LandmarkMapError(LidarError):
    """A map of landmarks cannot be read or written: no map, another version or unit, damaged, locked, disk full."""


class UnknownLandmarkError(LandmarkMapError, LookupError):
    """The map holds no landmark with this id."""


class UnknownWallError(LandmarkMapError, LookupError):
    """The map never held a wall with this id."""


class UnknownSessionError(LandmarkMapError, LookupError):
    """The database holds no session with this id."""


class MapFileError(LandmarkMapError):
    """No map comes from this file, or no such file from a map: format, version, size, nothing in it, disk full."""


class GridError(LidarError, ValueError):
    """An occupancy grid cannot be made: too many cells, no scans, a pose or a size that is no number."""


class MaskError(LidarError, ValueError):
    """A mask of the robot's body makes no sense, or cannot be suggested from these scans."""


class MeasureError(LidarError, LookupError):
    """What is to be measured in a map is not there, or has no such distance or angle."""


class LocalizationError(LidarError, ValueError):
    """What a filter was given cannot be used: shapes differ, or a number is not finite. Its state is untouched."""


class CovarianceError(LocalizationError):
    """A covariance is singular, not positive, not symmetric or not finite."""


class MotionError(LocalizationError):
    """The clock went back, or odometry is missing or has jumped."""


class LostError(LocalizationError):
    """The pose cannot be found from one scan alone: nothing in the map explains it, or several places do."""


class SimulationError(LidarError, ValueError):
    """What is to be simulated does not exist or does not fit: an unknown world or path, too many posts."""


class EvaluationError(LidarError, ValueError):
    """A study makes no sense or cannot go on: an unknown room, results of another study, no scheduler there."""


class ServerUnreachableError(LidarError):
    """No server answers at this address."""


class ClientError(LidarError):
    """The server refused what a client asked for, and says why: `status`, `title` and `detail` (RFC 9457)."""

    def __init__(self, status: int, title: str, detail: str) -> None:
        super().__init__(f"{title} ({status}): {detail}")
        self.status, self.title, self.detail = status, title, detail
