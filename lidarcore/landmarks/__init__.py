"""Landmarks that outlive a run: an embedded database of maps with spatial queries, and exchange with other programs."""

from lidarcore.landmarks.atlas import MAX_NAME, Atlas, Session, session_name
from lidarcore.landmarks.exchange import FORMATS, export_map, import_map, read_landmarks, write_landmarks
from lidarcore.landmarks.landmark import MAX_COORDINATE, MAX_ID, Landmark
from lidarcore.landmarks.landmark_map import LandmarkMap
from lidarcore.landmarks.nearest import Metric, Neighbour
from lidarcore.landmarks.picture import export_picture
from lidarcore.landmarks.queries import Box, Circle, Filter, Page
from lidarcore.landmarks.stored_grid import StoredGrid
from lidarcore.landmarks.stored_wall import StoredWall

__all__ = [
    "FORMATS",
    "MAX_COORDINATE",
    "MAX_ID",
    "MAX_NAME",
    "Atlas",
    "Box",
    "Circle",
    "Filter",
    "Landmark",
    "LandmarkMap",
    "Metric",
    "Neighbour",
    "Page",
    "Session",
    "StoredGrid",
    "StoredWall",
    "export_map",
    "export_picture",
    "import_map",
    "read_landmarks",
    "session_name",
    "write_landmarks",
]
