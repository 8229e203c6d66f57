"""Walls of a map: the segments of all keyframes as lines with ends, corners and covariances."""

from lidarcore.mapping.walls.identity import WallIds
from lidarcore.mapping.walls.joint import JointWalls, corner_ends
from lidarcore.mapping.walls.kept import MOST_WALLS, pack_covariance, unpack_covariance
from lidarcore.mapping.walls.query import along, distances, in_box, nearest
from lidarcore.mapping.walls.settings import WallSettings
from lidarcore.mapping.walls.spread import Spread, common_spread, joint_spread
from lidarcore.mapping.walls.table import WallTable
from lidarcore.mapping.walls.walls import WallCorners, Walls, find_walls

__all__ = [
    "MOST_WALLS",
    "JointWalls",
    "Spread",
    "WallCorners",
    "WallIds",
    "WallSettings",
    "WallTable",
    "Walls",
    "along",
    "common_spread",
    "corner_ends",
    "distances",
    "find_walls",
    "in_box",
    "joint_spread",
    "nearest",
    "pack_covariance",
    "unpack_covariance",
]
