"""ROS messages, ROS 1 or ROS 2, decoded by rosbags; LaserScan to Scan."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import RecordingError, ScanError
from lidarcore.recordings.base import MOST_BEAMS
from lidarcore.recordings.beams import BEAMS, BEAMS_DEFINITION
from lidarcore.scan import Scan

LASER = "sensor_msgs/LaserScan"
ODOMETRY = "nav_msgs/Odometry"
TRANSFORMS = "tf2_msgs/TFMessage"
MOST_TOPICS = 10_000
WANTED = (LASER, BEAMS, ODOMETRY, TRANSFORMS)

_ONE_TURN = 2 * np.pi + 1e-3  # angle_increment is a float32


class Message(NamedTuple):
    """A message as recorded: type as package/Name, encoding "ros1" or "cdr", time of recording in s."""

    topic: str
    type: str
    encoding: str
    time: float
    data: bytes


def plain_type(name: str) -> str:
    """Bring the names of a type in ROS 1, ROS 2 and the old tf to one: package/Name."""
    name = name.replace("/msg/", "/")
    return TRANSFORMS if name == "tf/tfMessage" else name


def check_topics(number: int) -> None:
    """Raise RecordingError if there are more topics, or connections, than any robot has."""
    if number > MOST_TOPICS:
        raise RecordingError(f"This holds more than {MOST_TOPICS} topics: no robot has so many.")


@cache
def typestore(encoding: str) -> Any:
    """Types of ROS 1 ("ros1") or ROS 2 ("cdr") as rosbags knows them, with those it lacks."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    definitions = {TRANSFORMS: "geometry_msgs/TransformStamped[] transforms", BEAMS: BEAMS_DEFINITION}
    for name, definition in definitions.items():
        store.register(get_types_from_msg(definition, name.replace("/", "/msg/")))
    return store


def decode(message: Message) -> Any | None:
    """Decode a message; None if it is damaged."""
    store = typestore(message.encoding)
    deserialize = store.deserialize_ros1 if message.encoding == "ros1" else store.deserialize_cdr
    try:
        return deserialize(message.data, message.type.replace("/", "/msg/"))
    except Exception:  # the generated decoders raise whatever the bytes lead them to
        return None


def seconds(header: Any) -> float:
    """Stamp of a message's header in s; 0 if it was not set."""
    return float(header.stamp.sec + header.stamp.nanosec / 1e9)


def frame(name: str) -> str:
    """Name of a coordinate frame without the leading slash of ROS 1."""
    return name.strip("/")


def scan_of(
    laser: Any,
    beams: Any | None,
    stamp: float,
    *,
    mirrored: bool,
    odometry: Array | None,
    count: Callable[[str, int], None],
) -> Scan:
    """Turn a LaserScan, with the Beams message of our own recordings if there is one, into a Scan.

    mirrored: the sensor hangs upside down, so that its counter-clockwise is seen as clockwise from above.
    What is left out or turned goes to `count`. Raises ScanError if the angles make no sense.
    """
    if len(laser.ranges) > MOST_BEAMS:
        raise ScanError(f"more than {MOST_BEAMS} beams")
    ranges = _within_limits(laser, count)
    increment = -laser.angle_increment if mirrored else laser.angle_increment
    if not 0 < abs(increment) * max(len(ranges) - 1, 1) <= _ONE_TURN:
        raise ScanError(f"{len(ranges)} beams {increment:.6g} rad apart: expected radians, at most one turn")
    if beams is None:
        count("scans that ran clockwise, turned", int(increment < 0))
        bearings = laser.angle_min + laser.angle_increment * np.arange(len(ranges))
        times = laser.time_increment * np.arange(len(ranges)) if 0 < laser.time_increment < np.inf else None
        if times is not None and _is_listed_backwards(laser):
            count(
                "scans listed from the last beam to the first, as ROS does of RPLIDARs; beam times turned", 1
            )
            times = times[::-1]
        gaps, kept = np.empty((0, 2)), np.arange(len(ranges))
    else:
        bearings, gaps = beams.bearings, beams.gaps.reshape(-1, 2)
        times, kept = beams.times if len(beams.times) else None, np.flatnonzero(np.isfinite(bearings))
    if mirrored:
        bearings, gaps = -bearings, -gaps[:, ::-1]
    quality = laser.intensities if len(laser.intensities) == len(ranges) else None
    order = kept[::-1] if increment < 0 else kept
    return Scan(
        ranges[order],
        bearings[order],
        stamp,
        quality if quality is None else quality[order],
        times if times is None else times[order],
        odometry,
        gaps,
    )


def _is_listed_backwards(laser: Any) -> bool:
    """Whether a scan is one of ROS's RPLIDAR node, or of those made after it for other sensors that turn clockwise.

    It lists beams counter-clockwise, as it should, though they were taken clockwise, and gives them times as if they
    had been taken as they are listed (github.com/Slamtec/rplidar_ros, issue 55). What the sensor calls 0 it calls pi,
    where the last beam is; the first lies 359 or 360 degrees before, and its scans take as long as all intervals.
    """
    steps = len(laser.ranges) - 1
    span = steps * laser.angle_increment
    is_turn = any(math.isclose(span, math.radians(turn), abs_tol=1e-4) for turn in (359, 360))
    begins_at_pi = math.isclose(laser.angle_min + span, math.pi, abs_tol=1e-4)
    return (
        is_turn and begins_at_pi and math.isclose(steps * laser.time_increment, laser.scan_time, rel_tol=1e-5)
    )


def _within_limits(laser: Any, count: Callable[[str, int], None]) -> Array:
    """Ranges (N,) of a LaserScan; outside [range_min, range_max) is no return (REP-117)."""
    with np.errstate(invalid="ignore"):  # of signalling NaN in damaged files
        ranges = np.asarray(laser.ranges, np.float64)
    lower, upper = float(laser.range_min), float(laser.range_max)
    if not 0 <= lower < upper:
        count(
            f"scans with senseless limits (range_min {lower:g}, range_max {upper:g} m), which are ignored", 1
        )
        return ranges
    beyond, below = np.isfinite(ranges) & (ranges >= upper), (ranges > 0) & (ranges < lower)
    count(f"ranges at or beyond range_max ({upper:g} m) taken as missing", int(beyond.sum()))
    count(f"ranges below range_min ({lower:g} m) taken as missing", int(below.sum()))
    ranges[beyond | below] = np.nan
    return ranges
