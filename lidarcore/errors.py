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
