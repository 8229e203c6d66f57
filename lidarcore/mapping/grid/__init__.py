"""Which parts of a plane are occupied, which are free, and which nobody has seen: from scans, and as ROS keeps it."""

from lidarcore.mapping.grid.builder import GridBuilder, build_grid
from lidarcore.mapping.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from lidarcore.mapping.grid.ros_map import read_ros_map, shades_of, write_ros_map
from lidarcore.mapping.grid.settings import GridSettings

__all__ = [
    "FREE",
    "OCCUPIED",
    "UNKNOWN",
    "GridBuilder",
    "GridSettings",
    "OccupancyGrid",
    "build_grid",
    "read_ros_map",
    "shades_of",
    "write_ros_map",
]
