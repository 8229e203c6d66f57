"""A recording of two lidars, of which one has to be chosen."""

from pathlib import Path

from mcap_ros2.writer import Writer

LASER_SCAN = """std_msgs/Header header
float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def write_two_lidars(path: Path) -> Path:
    """A bag with the topics /front and /rear, written by a library of its own."""
    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("sensor_msgs/msg/LaserScan", LASER_SCAN)
        for i in range(5):
            for topic, beams in (("/front", 360), ("/rear", 180)):
                step = 2 * 3.14159265 / beams
                message = {
                    "header": {"stamp": {"sec": 10 + i, "nanosec": 0}, "frame_id": "laser"},
                    "angle_min": -3.14159265, "angle_max": 3.14159265 - step, "angle_increment": step,
                    "time_increment": 0.0, "scan_time": 1.0, "range_min": 0.1, "range_max": 10.0,
                    "ranges": [2.0] * beams, "intensities": [],
                }  # fmt: skip
                writer.write_message(topic, schema, message, log_time=i * 10**9, publish_time=i * 10**9)
        writer.finish()
    return path
