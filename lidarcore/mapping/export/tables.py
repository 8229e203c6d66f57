"""Walls as CSV and GeoJSON: metres, radians, seconds, and saying so."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from lidarcore.files.texts import csv_text, json_lines
from lidarcore.mapping.walls import Walls, WallTable

Row = dict[str, Any]

_COLUMNS = (
    "id", "alpha_rad", "r_m", "x1_m", "y1_m", "x2_m", "y2_m", "length_m", "var_alpha_rad2", "cov_alpha_r_rad_m",
    "var_r_m2", "var_length_m2", "ended_1", "ended_2", "corner_1", "corner_2", "first_seen_s", "last_seen_s", "count",
)  # fmt: skip


def walls_csv(walls: WallTable, chosen: Iterable[int] | None = None) -> str:
    """A line for each wall, or each chosen one; where it may go on beyond an end, `ended` is 0, `length` the least."""
    return csv_text((_row(walls, i) for i in (range(len(walls)) if chosen is None else chosen)), _COLUMNS)


def walls_geojson(walls: WallTable, chosen: Iterable[int] | None = None) -> str:
    """Walls as LineStrings, known corners as Points, in the map's own metres, not degrees; the chosen ones, if any."""
    kept = dict.fromkeys(range(len(walls)) if chosen is None else chosen)
    features = [_wall_feature(walls, i) for i in kept]
    if isinstance(walls, Walls):
        corners = walls.corners.walls.tolist()
        features += [_corner_feature(walls, k) for k, pair in enumerate(corners) if set(pair) <= kept.keys()]
    head = {"type": "FeatureCollection", "format": "lidarcore walls", "version": 1, "unit": "m"}
    return "".join(json_lines(head, "features", features))


def _row(walls: WallTable, i: int) -> Row:
    """What a file says of a wall."""
    C = walls.line_covariance[i]
    numbers = [walls.alpha[i], walls.r[i], *walls.ends[i].ravel(), walls.length[i]]
    numbers += [C[0, 0], C[0, 1], C[1, 1], walls.length_variance[i]]
    flags = np.concatenate([walls.ended[i], walls.in_corner[i]]).astype(int).tolist()
    seen = [float(walls.first_seen[i]), float(walls.last_seen[i]), int(walls.count[i])]
    values = [int(walls.ids[i]), *(float(f"{value:.9g}") for value in numbers), *flags, *seen]
    return dict(zip(_COLUMNS, values, strict=True))


def _wall_feature(walls: WallTable, i: int) -> Row:
    row = _row(walls, i)
    first, second = (row.pop("x1_m"), row.pop("y1_m")), (row.pop("x2_m"), row.pop("y2_m"))
    return _feature(f"wall-{row.pop('id')}", "LineString", [list(first), list(second)], row)


def _corner_feature(walls: Walls, k: int) -> Row:
    (v_x, c_xy), (_, v_y) = walls.corners.covariance[k].tolist()
    properties = {"var_x_m2": v_x, "cov_xy_m2": c_xy, "var_y_m2": v_y}
    properties["walls"] = [f"wall-{id}" for id in walls.ids[walls.corners.walls[k]].tolist()]
    return _feature(f"corner-{k}", "Point", walls.corners.xy[k].round(9).tolist(), properties)


def _feature(name: str, kind: str, coordinates: list[Any], properties: Row) -> Row:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "id": name, "geometry": geometry, "properties": properties}
