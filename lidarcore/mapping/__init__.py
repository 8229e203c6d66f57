"""Maps from whole scans: a front end without odometry, a pose graph that closes loops, honest covariances."""

from lidarcore.mapping.background import MapPicture
from lidarcore.mapping.consistency import Loop
from lidarcore.mapping.keyframes import Keyframes
from lidarcore.mapping.mapper import Mapper, Placement
from lidarcore.mapping.pose_graph import PoseGraph
from lidarcore.mapping.settings import FrontSettings, LoopSettings, MapperSettings, MatchSettings
from lidarcore.mapping.whole_scans import WholeScans

__all__ = [
    "FrontSettings",
    "Keyframes",
    "Loop",
    "LoopSettings",
    "MapPicture",
    "Mapper",
    "MapperSettings",
    "MatchSettings",
    "Placement",
    "PoseGraph",
    "WholeScans",
    "export",
    "grid",
    "measure",
    "precompile",
    "relocation",
    "scan_measure",
    "walls",
]
