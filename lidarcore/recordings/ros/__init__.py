"""ROS bags of both versions: messages, frames and what they hold of scans and odometry."""

from lidarcore.recordings.ros.rosbag1 import Rosbag1
from lidarcore.recordings.ros.rosbag2 import Rosbag2

__all__ = ["Rosbag1", "Rosbag2"]
