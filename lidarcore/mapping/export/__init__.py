"""A map as files that others use: ROS, CAD, GIS, spreadsheets and browsers."""

from lidarcore.mapping.export.drawings import corner_places, plan_dxf, plan_svg
from lidarcore.mapping.export.folder import MAP_FILES, write_map
from lidarcore.mapping.export.tables import read_walls_csv, walls_csv, walls_geojson

__all__ = [
    "MAP_FILES",
    "corner_places",
    "plan_dxf",
    "plan_svg",
    "read_walls_csv",
    "walls_csv",
    "walls_geojson",
    "write_map",
]
