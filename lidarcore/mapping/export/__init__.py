"""A map as files that others use: ROS, CAD, GIS, spreadsheets and browsers."""

from lidarcore.mapping.export.drawings import corner_places, plan_dxf, plan_svg
from lidarcore.mapping.export.folder import COVARIANCE_FILE, MAP_FILES, read_walls, write_map
from lidarcore.mapping.export.tables import read_walls_csv, walls_csv, walls_geojson

__all__ = [
    "COVARIANCE_FILE",
    "MAP_FILES",
    "corner_places",
    "plan_dxf",
    "plan_svg",
    "read_walls",
    "read_walls_csv",
    "walls_csv",
    "walls_geojson",
    "write_map",
]
