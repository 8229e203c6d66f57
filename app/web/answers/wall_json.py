"""Walls of a map as JSON: for answers, and all of them for the stream."""

from collections.abc import Iterable
from typing import cast

import numpy as np
from pydantic_core import to_json
from typing_extensions import TypedDict

from lidarcore.mapping.walls import Walls, WallTable, corner_ends

from ..schemas import Matrix, Pair

SAME = 1e-6  # m, between ends that are the same corner


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
    """The walls of a map, and the corners where they meet, with ids of these; none where there is no map."""
    if walls is None:
        return to_json({"walls": [], "corners": []}).decode()
    corners = [{"at": at, "walls": met} for at, met in _corners(walls)]
    return to_json({"walls": wall_rows(walls, range(len(walls))), "corners": corners}).decode()


def _corners(walls: WallTable) -> Iterable[tuple[list[float], list[int]]]:
    """Where walls meet, and the ids of both; of a map that is kept, of those that end there."""
    if isinstance(walls, Walls):
        return zip(walls.corners.xy.tolist(), walls.ids[walls.corners.walls].tolist(), strict=True)
    spots = walls.ends[tuple(corner_ends(walls).T)]
    meet = [(walls.in_corner & (np.abs(walls.ends - at) < SAME).all(-1)).any(-1) for at in spots]
    return zip(spots.tolist(), (walls.ids[some].tolist() for some in meet), strict=True)


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
