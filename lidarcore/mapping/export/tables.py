"""Walls as CSV and GeoJSON: metres, radians, seconds, and saying so."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import MapFileError
from lidarcore.files import reason
from lidarcore.files.texts import csv_text, json_lines
from lidarcore.mapping.walls import Walls, WallTable

Row = dict[str, Any]

_COLUMNS = (
    "id", "alpha_rad", "r_m", "x1_m", "y1_m", "x2_m", "y2_m", "length_m", "var_alpha_rad2", "cov_alpha_r_rad_m",
    "var_r_m2", "var_length_m2", "ended_1", "ended_2", "corner_1", "corner_2", "first_seen_s", "last_seen_s", "count",
)  # fmt: skip
_MOST = 100_000  # walls in a file


def walls_csv(walls: WallTable, chosen: Iterable[int] | None = None) -> str:
    """A line for each wall, or each chosen one; where it may go on beyond an end, `ended` is 0, `length` the least."""
    return csv_text((_row(walls, i) for i in (range(len(walls)) if chosen is None else chosen)), _COLUMNS)


def read_walls_csv(path: str | Path) -> WallTable:
    """The walls of a file that `walls_csv` wrote.

    Raises MapFileError, which names what is wrong, if it cannot be read, lacks a column, or holds a wall that makes no
    sense.
    """
    name = Path(path).name
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            return _table(_numbers(csv.DictReader(file, strict=True)))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MapFileError(f"{name} cannot be read: {reason(error)}.") from error
    except MapFileError as error:
        raise MapFileError(f"{name}: {error}") from error


def _numbers(rows: "csv.DictReader[str]") -> Array:
    """(W, columns) of what a file says. Raises MapFileError."""
    if missing := set(_COLUMNS) - set(rows.fieldnames or ()):
        raise MapFileError(f"It lacks the columns {', '.join(sorted(missing))}: save the walls anew.")
    found: list[list[float]] = []
    for row in rows:
        try:
            found.append([float(row[column]) for column in _COLUMNS])
        except (TypeError, ValueError) as error:
            raise MapFileError(f"Line {rows.line_num} holds what is not a number: {error}.") from error
        if len(found) > _MOST:
            raise MapFileError(f"It holds more than {_MOST} walls: save a part of them.")
    return np.reshape(found, (-1, len(_COLUMNS)))


def _table(numbers: Array) -> WallTable:
    """Walls by the numbers of a file, in its order. Raises MapFileError."""
    said = dict(zip(_COLUMNS, numbers.T, strict=True))
    ids, count = said["id"], said["count"]
    alphas, rs = said["var_alpha_rad2"], said["var_r_m2"]
    flags = np.stack([said[name] for name in ("ended_1", "ended_2", "corner_1", "corner_2")], -1)
    makes_sense = {
        "numbers that are finite": np.isfinite(numbers).all(-1),
        "an id that is a whole number from 0 on": (ids >= 0) & (ids % 1 == 0) & (ids < 2**53),
        "a count that is a whole number from 1 on": (count >= 1) & (count % 1 == 0) & (count < 2**53),
        "ended and corner that are 0 or 1": np.isin(flags, [0, 1]).all(-1),
        "variances that are not below 0": (alphas >= 0) & (rs >= 0) & (said["var_length_m2"] >= 0),
        "a covariance of alpha and r that their variances allow": said["cov_alpha_r_rad_m"] ** 2
        <= alphas * rs * (1 + 1e-6),
    }
    for what, makes in makes_sense.items():
        if not makes.all():
            raise MapFileError(f"Wall {int(np.argmin(makes)) + 1} lacks {what}.")
    if len(np.unique(ids)) < len(ids):
        raise MapFileError("Two of the walls have the same id: give each its own.")
    cross = said["cov_alpha_r_rad_m"]
    return WallTable(
        ids.astype(np.int64),
        said["alpha_rad"],
        said["r_m"],
        np.stack([alphas, cross, cross, rs], -1).reshape(-1, 2, 2),
        np.stack([said[name] for name in ("x1_m", "y1_m", "x2_m", "y2_m")], -1).reshape(-1, 2, 2),
        flags[:, :2].astype(bool),
        flags[:, 2:].astype(bool),
        said["length_m"],
        said["var_length_m2"],
        said["first_seen_s"],
        said["last_seen_s"],
        count.astype(np.int64),
    )


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
