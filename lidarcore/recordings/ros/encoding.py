"""A scan and its features as ROS 2 messages of the standard types, ready to be written."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array
from lidarcore.errors import RecordingError
from lidarcore.features import Features
from lidarcore.recordings.beams import BEAMS, Grid, grid
from lidarcore.recordings.ros.messages import LASER, ODOMETRY, TRANSFORMS, typestore
from lidarcore.scan import Scan

MARKERS = "visualization_msgs/MarkerArray"
SENSOR_FRAME, ODOMETRY_FRAME = "laser", "odom"
LIMITS = (0.05, 40.0)
"""m, range_min and range_max: those of an RPLIDAR S1. A scan that goes beyond widens its own."""

Messages = dict[str, tuple[str, Any]]
"""topic: type as package/Name, message"""

_SEGMENTS, _CORNERS, _ELLIPSES = (
    (0.26, 0.61, 1.0, 1.0),
    (1.0, 0.55, 0.1, 1.0),
    (1.0, 0.55, 0.1, 0.35),
)  # r, g, b, a
_LINE_LIST, _SPHERE_LIST, _CYLINDER = 5, 7, 3
_ADD, _DELETE_ALL = 0, 3
_FLAT = 1e-3  # m, thickness of what is drawn


def encoded(scan: Scan, features: Features | None, ellipse_scale: float) -> Messages:
    """Messages of one scan, all with its stamp; what others refer to comes first.

    Raises RecordingError if the stamp is beyond what ROS 2 can express.
    """
    head = header(scan.stamp, SENSOR_FRAME)
    layout = grid(scan)
    made: Messages = {}
    if scan.odometry is not None:
        made |= _odometry(scan.odometry, header(scan.stamp, ODOMETRY_FRAME))
    made["/scan/beams"] = BEAMS, _beams(scan, layout, head)
    made["/scan"] = LASER, _laser(scan, layout, head)
    if features is not None:
        made["/features"] = MARKERS, _markers(features, head, ellipse_scale)
    return made


def header(stamp: float, frame: str) -> Any:
    """std_msgs/Header of a stamp in s."""
    seconds = int(np.floor(stamp))
    nanoseconds = round((stamp - seconds) * 1e9)
    if nanoseconds == 10**9:
        seconds, nanoseconds = seconds + 1, 0
    if not -(2**31) <= seconds < 2**31:
        raise RecordingError(
            f"The stamp {stamp:g} s cannot be written: ROS 2 holds seconds in 32 bits. Give Unix time, or 0 if unknown."
        )
    return _make("std_msgs/Header", _make("builtin_interfaces/Time", seconds, nanoseconds), frame)


def _make(type_: str, *fields: Any) -> Any:
    return typestore("cdr").types[type_.replace("/", "/msg/")](*fields)


def _beams(scan: Scan, layout: Grid, head: Any) -> Any:
    times = np.empty(0) if scan.beam_times is None else layout.spread(scan.beam_times)
    return _make(BEAMS, head, layout.spread(scan.bearings), times.astype(np.float32), scan.gaps.ravel())


def _laser(scan: Scan, layout: Grid, head: Any) -> Any:
    """No return is inf (REP-117), data lost are NaN."""
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers beyond 32 bits, which become inf
        ranges = layout.spread(np.where(scan.valid, scan.ranges, np.inf)).astype(np.float32)
        span = 0.0 if scan.beam_times is None else np.ptp(scan.beam_times)
        between = np.float32(span / max(layout.size - 1, 1))
        period = between * np.float32(layout.size)
        quality = np.empty(0) if scan.quality is None else layout.spread(scan.quality, 0)
        quality = quality.astype(np.float32)
    seen = ranges[np.isfinite(ranges)]
    nearest, farthest = seen.min(initial=LIMITS[0]), seen.max(initial=0)
    return _make(
        LASER,
        head,
        layout.angle_min,
        layout.angle_min + layout.increment * (layout.size - 1),
        layout.increment,
        float(between),
        float(period),
        float(nearest),
        max(LIMITS[1], float(np.nextafter(farthest, np.float32(np.inf)))),  # range_max itself is no return
        ranges,
        quality,
    )


def _pose(x: float, y: float, heading: float, kind: str = "Point") -> tuple[Any, Any]:
    """Place (as Point or Vector3) and orientation of a planar pose."""
    turn = _make("geometry_msgs/Quaternion", 0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
    return _make(f"geometry_msgs/{kind}", x, y, 0.0), turn


def _odometry(T_odom_sensor: Array, head: Any) -> Messages:
    x, y, heading = T_odom_sensor.tolist()
    transform = _make("geometry_msgs/Transform", *_pose(x, y, heading, "Vector3"))
    unknown = np.zeros(36)
    zero = _make("geometry_msgs/Vector3", 0.0, 0.0, 0.0)
    pose = _make(
        "geometry_msgs/PoseWithCovariance", _make("geometry_msgs/Pose", *_pose(x, y, heading)), unknown
    )
    twist = _make("geometry_msgs/TwistWithCovariance", _make("geometry_msgs/Twist", zero, zero), unknown)
    stamped = _make("geometry_msgs/TransformStamped", head, SENSOR_FRAME, transform)
    return {
        "/tf": (TRANSFORMS, _make(TRANSFORMS, [stamped])),
        "/odom": (ODOMETRY, _make(ODOMETRY, head, SENSOR_FRAME, pose, twist)),
    }


def _markers(features: Features, head: Any, ellipse_scale: float) -> Any:
    """Walls as lines, corners as dots, and their ellipses as flat cylinders; what was drawn before is deleted."""
    segments, corners = features.segments, features.corners
    ends = np.stack([segments.start, segments.end], 1).reshape(-1, 2)
    markers = [_marker(head, "", 0, _ADD, action=_DELETE_ALL)]
    if len(ends):
        markers.append(_marker(head, "segments", 0, _LINE_LIST, (0.03, 0.0, 0.0), _SEGMENTS, ends))
    if len(corners):
        markers.append(_marker(head, "corners", 0, _SPHERE_LIST, (0.08, 0.08, 0.08), _CORNERS, corners.xy))
    variances, axes = np.linalg.eigh(corners.covariance)
    sizes = np.maximum(2 * ellipse_scale * np.sqrt(np.maximum(variances, 0)), _FLAT)
    angles = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    name = f"ellipses of {ellipse_scale:g} sigma"
    for i, (xy, size, angle) in enumerate(
        zip(corners.xy.tolist(), sizes.tolist(), angles.tolist(), strict=True)
    ):
        markers.append(_marker(head, name, i, _CYLINDER, (*size, _FLAT), _ELLIPSES, pose=(*xy, angle)))
    return _make(MARKERS, markers)


def _marker(
    head: Any,
    namespace: str,
    id_: int,
    kind: int,
    scale: tuple[float, ...] = (1.0, 1.0, 1.0),
    colour: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0),
    points: Array | None = None,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    action: int = _ADD,
) -> Any:
    """visualization_msgs/Marker at a pose, with points (P, 2) relative to it, that stays until it is deleted."""
    nothing: NDArray[np.uint8] = np.empty(0, np.uint8)
    zero = _make("builtin_interfaces/Time", 0, 0)
    corners = [] if points is None else [_make("geometry_msgs/Point", x, y, 0.0) for x, y in points.tolist()]
    return _make(
        "visualization_msgs/Marker",
        head,
        namespace,
        id_,
        kind,
        action,
        _make("geometry_msgs/Pose", *_pose(*pose)),
        _make("geometry_msgs/Vector3", *scale),
        _make("std_msgs/ColorRGBA", *colour),
        _make("builtin_interfaces/Duration", 0, 0),
        False,
        corners,
        [],
        "",
        _make("sensor_msgs/CompressedImage", _make("std_msgs/Header", zero, ""), "", nothing),
        [],
        "",
        "",
        _make("visualization_msgs/MeshFile", "", nothing),
        False,
    )
