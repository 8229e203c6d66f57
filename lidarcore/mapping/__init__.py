"""Maps from whole scans: a front end without odometry, a pose graph that closes loops, honest covariances."""

from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.live.background import MapPicture
from lidarcore.mapping.live.whole_scans import WholeScans
from lidarcore.mapping.loops.consistency import Loop
from lidarcore.mapping.loops.keyframes import Keyframes
from lidarcore.mapping.mapper import Mapper, Placement
from lidarcore.mapping.settings import FrontSettings, LoopSettings, MapperSettings, MatchSettings

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
