"""Where scans lie on each other, and the map that follows: scan matching with honest covariances, pose-graph SLAM."""

from lidarcore.scanmatching.loops import Loop
from lidarcore.scanmatching.mapper import Placement, ScanSlam
from lidarcore.scanmatching.matching import ScanMatch, match_scans
from lidarcore.scanmatching.pose_graph import PoseGraph
from lidarcore.scanmatching.settings import LoopSettings, MatchSettings, ScanSlamSettings
from lidarcore.scanmatching.surface import Surface, surface

__all__ = [
    "Loop",
    "LoopSettings",
    "MatchSettings",
    "Placement",
    "PoseGraph",
    "ScanMatch",
    "ScanSlam",
    "ScanSlamSettings",
    "Surface",
    "match_scans",
    "surface",
]
