"""Small ROS recordings, written by libraries that nobody here wrote."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as McapWriter
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NOETIC, HUMBLE = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
NOETIC.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))

TimedMessage = tuple[str, str, dict[str, Any], float]
"""topic, type as package/Name, fields, time of recording in s"""


def header(stamp: float, frame: str) -> dict[str, Any]:
    nanoseconds = round(stamp * 1e9)
    return {"stamp": {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}, "frame_id": frame}


def quaternion(roll: float = 0.0, yaw: float = 0.0) -> dict[str, float]:
    """Rotation by roll about x, then by yaw about the parent's z."""
    cr, sr, cy, sy = math.cos(roll / 2), math.sin(roll / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return {"x": sr * cy, "y": sr * sy, "z": cr * sy, "w": cr * cy}


def laser(stamp: float, ranges: Iterable[float], frame: str = "laser", **fields: Any) -> dict[str, Any]:
    return {
        "header": header(stamp, frame),
        "angle_min": -1.5, "angle_max": 1.5, "angle_increment": 0.25, "time_increment": 0.0, "scan_time": 0.1,
        "range_min": 0.1, "range_max": 12.0, "ranges": list(map(float, ranges)), "intensities": [],
    } | fields  # fmt: skip


def transform(parent: str, child: str, x: float, y: float, rotation: dict[str, float]) -> dict[str, Any]:
    place = {"translation": {"x": x, "y": y, "z": 0.1}, "rotation": rotation}
    return {"transforms": [{"header": header(0, parent), "child_frame_id": child, "transform": place}]}


def odometry(stamp: float, x: float, y: float, yaw: float, child: str = "base_link") -> dict[str, Any]:
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": quaternion(yaw=yaw)}
    covariance = [0.0] * 36
    return {
        "header": header(stamp, "odom"), "child_frame_id": child,
        "pose": {"pose": pose, "covariance": covariance},
        "twist": {"twist": {"linear": zero, "angular": zero}, "covariance": covariance},
    }  # fmt: skip


def write_mcap(
    path: Path, messages: Iterable[TimedMessage], compression: CompressionType, chunk: int = 4096
) -> None:
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk, compression=compression)
        schemas = {}
        for topic, type_, content, time in messages:
            if type_ not in schemas:
                name = type_.replace("/", "/msg/")
                schemas[type_] = writer.register_msgdef(name, HUMBLE.generate_msgdef(name, ros_version=2)[0])
            writer.write_message(topic, schemas[type_], content, log_time=round(time * 1e9))
        writer.finish()


def _message(store: Any, name: str, content: Any) -> Any:
    """Make a message of rosbags from its fields."""
    known = store.types[name]
    fields = {"seq": 0, **content} if name == "std_msgs/msg/Header" and store is NOETIC else content
    made = {}
    for field, (kind, detail) in store.get_msgdef(name).fields:
        value = fields[field]
        if kind == Nodetype.NAME:
            value = _message(store, detail, value)
        elif kind != Nodetype.BASE and detail[0][0] == Nodetype.BASE:
            value = np.array(value, detail[0][1][0])
        elif kind != Nodetype.BASE:
            value = [_message(store, detail[0][1], entry) for entry in value]
        made[field] = value
    return known(**made)


def write_bag1(path: Path, messages: Iterable[TimedMessage], compression: str | None = None) -> None:
    writer = Bag1Writer(path)
    if compression:
        writer.set_compression(Bag1Writer.CompressionFormat[compression.upper()])
    with writer:
        connections: dict[str, Any] = {}
        for topic, type_, content, time in messages:
            name = type_.replace("/", "/msg/")
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=NOETIC)
            raw = NOETIC.serialize_ros1(_message(NOETIC, name, content), name)
            writer.write(connections[topic], round(time * 1e9), raw)


def drive() -> list[TimedMessage]:
    """A robot that drives 1 m/s along x for 1 s, its lidar 0.2 m ahead, 0.1 m left, turned a quarter left."""
    mounting = transform("base_link", "laser", 0.2, 0.1, quaternion(yaw=math.pi / 2))
    static = [("/tf_static", "tf2_msgs/TFMessage", mounting, 100.0)]
    moves = [
        ("/odom", "nav_msgs/Odometry", odometry(100 + t, t, 0.0, 0.0), 100 + t) for t in np.linspace(0, 1, 21)
    ]
    scans = [
        ("/scan", "sensor_msgs/LaserScan", laser(100 + t, 1 + t + np.arange(13)), 100.01 + t)
        for t in np.linspace(0.02, 0.92, 10)
    ]
    return static + sorted(moves + scans, key=lambda message: message[3])
