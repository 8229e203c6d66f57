"""A map as files that others use: ROS, CAD, GIS, spreadsheets and browsers."""

from lidarcore.mapping.export.drawings import plan_dxf, plan_svg
from lidarcore.mapping.export.folder import MAP_FILES, write_map
from lidarcore.mapping.export.tables import walls_csv, walls_geojson

__all__ = ["MAP_FILES", "plan_dxf", "plan_svg", "walls_csv", "walls_geojson", "write_map"]
