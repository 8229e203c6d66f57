"""Walls of a map as JSON: for answers, and all of them for the stream."""

from collections.abc import Iterable
from typing import cast

import numpy as np
from pydantic_core import to_json
from typing_extensions import TypedDict

from lidarcore.mapping.walls import Walls, WallTable

from .schemas import Matrix, Pair


class WallJson(TypedDict):
    """A surface seen from one side: x cos(alpha) + y sin(alpha) = r, rad and m, in the frame of the map.

    `covariance` is of (alpha, r); `ended` is false at an end beyond which the wall may go on, for nobody looked there;
    `count` scans of the map saw it. `id` stays while the map grows and bends, and is not given twice in one map. Walls
    that become one keep the oldest id; the longest part of a wall that is cut keeps its id.
    """

    id: int
    alpha: float
    r: float
    covariance: Matrix
    start: Pair
    end: Pair
    length: float
    length_variance: float
    ended: tuple[bool, bool]
    in_corner: tuple[bool, bool]
    first_seen: float
    last_seen: float
    count: int


def walls_text(walls: WallTable | None) -> str:
    """The walls of a map, and the corners where two of them meet, with the ids of both; none where there is no map.

    Of a map that is kept it is not known which walls meet.
    """
    if walls is None:
        return to_json({"walls": [], "corners": []}).decode()
    met = []
    if isinstance(walls, Walls):
        corners = zip(walls.corners.xy.tolist(), walls.ids[walls.corners.walls].tolist(), strict=True)
        met = [{"at": at, "walls": pair} for at, pair in corners]
    return to_json({"walls": wall_rows(walls, range(len(walls))), "corners": met}).decode()


def wall_rows(walls: WallTable, chosen: Iterable[int]) -> list[WallJson]:
    """An object for each of the walls chosen by their places in the table."""
    given = {
        "id": walls.ids,
        "covariance": walls.line_covariance,
        "start": walls.ends[:, 0],
        "end": walls.ends[:, 1],
    }
    names, rows = WallJson.__annotations__, np.fromiter(chosen, int)
    columns = [(given[name] if name in given else getattr(walls, name))[rows].tolist() for name in names]
    return cast(list[WallJson], [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)])
