"""Landmarks that outlive a run: an embedded database with spatial queries, and exchange with other programs."""

from lidarcore.landmarks.exchange import FORMATS, export_map, import_map, read_landmarks, write_landmarks
from lidarcore.landmarks.landmark import Landmark
from lidarcore.landmarks.nearest import Metric, Neighbour
from lidarcore.landmarks.picture import export_picture
from lidarcore.landmarks.queries import Box, Circle, Filter, Page
from lidarcore.landmarks.store import LandmarkMap, Session, State

__all__ = [
    "FORMATS",
    "Box",
    "Circle",
    "Filter",
    "Landmark",
    "LandmarkMap",
    "Metric",
    "Neighbour",
    "Page",
    "Session",
    "State",
    "export_map",
    "export_picture",
    "import_map",
    "read_landmarks",
    "write_landmarks",
]
