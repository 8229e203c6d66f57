"""Places that can be measured from: the corners and walls nearest to them, of a scan or of a map."""

import re
from typing import Annotated, Literal, NamedTuple, cast

import numpy as np
from fastapi import Query
from pydantic import AfterValidator
from typing_extensions import TypedDict

from lidarcore import Array
from lidarcore.geometry import act
from lidarcore.mapping.measure import Feature
from lidarcore.mapping.walls import JointWalls

from ...errors import NotFoundError
from ...pipeline.frame import Frame
from ..schemas import Pair

SNAP = 0.3  # m; what is farther away was not meant

_Candidates = tuple[list[Feature], list[int], Array]  # each with its id, and its place (N, 2) m that is meant

_PLACE = r"^((map-)?(corner|wall)@-?\d{1,6}(\.\d{1,12})?,-?\d{1,6}(\.\d{1,12})?|map-wall:\d{1,18})$"


def _place(text: str) -> str:
    if not re.search(_PLACE, text):
        raise ValueError(
            f"{text!r} is no place: write corner@x,y, wall@x,y, map-corner@x,y or map-wall@x,y, x and y in metres, or "
            "map-wall:ID, the id as /walls gives it"
        )
    return text


Place = Annotated[
    str,
    AfterValidator(_place),
    Query(
        json_schema_extra={"pattern": _PLACE},
        description="corner@x,y or wall@x,y: the nearest of the scan to a place, m, in the frame of the map or of the "
        "sensor; map-corner@x,y or map-wall@x,y: of the map of whole scans; map-wall:ID: its wall with that id, as "
        "/walls gives it",
        examples=["corner@3.1,1.99", "map-wall:7"],
    ),
]


Kind = Literal["corner", "wall", "map-corner", "map-wall"]


class MeasuredFeatureJson(TypedDict):
    """`id` of a corner as frames have it, of a wall its number in this frame, of a wall of the map its id; `at`, the
    place on it, m, of a wall that was named by its id its middle. Corners of the map have no ids that last: theirs is
    the number among them now.
    """

    kind: Kind
    id: int
    at: Pair


class Found(NamedTuple):
    feature: Feature
    said: MeasuredFeatureJson


def found_at(where: Frame | JointWalls, place: str) -> Found:
    """The corner or wall of a scan or map that a place means. Raises NotFoundError."""
    _, _, id = place.partition(":")
    return _wall(where, int(id)) if id and isinstance(where, JointWalls) else _nearest(where, place)


def _wall(walls: JointWalls, id: int) -> Found:
    """The wall with an id. Raises NotFoundError."""
    where = np.flatnonzero(walls.ids == id)
    if not len(where):
        raise NotFoundError(
            f"The map has no wall {id} now: take an id that /walls gives. Walls that become one keep the oldest id."
        )
    x, y = walls.ends[where[0]].mean(0).tolist()
    return Found(Feature("wall", id), {"kind": "map-wall", "id": id, "at": (x, y)})


def _nearest(where: Frame | JointWalls, place: str) -> Found:
    """The corner or wall nearest to a place. Raises NotFoundError."""
    kind, _, xy = place.partition("@")
    at = np.array([float(value) for value in xy.split(",")])
    features, ids, spots = (
        _of_map(where, kind, at) if isinstance(where, JointWalls) else _of_scan(where, kind, at)
    )
    ways = np.hypot(*(spots - at).T)
    if not len(ways) or ways.min() > SNAP:
        raise NotFoundError(f"There is no {kind} within {SNAP} m of {xy}: give a place nearer to one.")
    nearest = int(ways.argmin())
    x, y = spots[nearest].tolist()
    return Found(features[nearest], {"kind": cast(Kind, kind), "id": ids[nearest], "at": (x, y)})


def _of_scan(frame: Frame, kind: str, at: Array) -> _Candidates:
    """Corners or walls of the scan by the main method, with their numbers and places."""
    if kind == "corner":
        main = next(iter(frame.features))
        ids = {row.index[main]: row.id for row in frame.corners if main in row.index}
        spots = act(frame.pose, frame.main.corners.xy)
        return [Feature("corner", i) for i in range(len(spots))], [ids[i] for i in range(len(spots))], spots
    start, end = (act(frame.pose, p) for p in (frame.main.segments.start, frame.main.segments.end))
    numbers = list(range(len(start)))
    return [Feature("wall", i) for i in numbers], numbers, _closest(at, start, end)


def _of_map(walls: JointWalls, kind: str, at: Array) -> _Candidates:
    if kind == "map-corner":
        numbers = list(range(len(walls.corners)))
        return [Feature("corner", i) for i in numbers], numbers, walls.corners.xy
    ids = walls.ids.tolist()
    return [Feature("wall", id) for id in ids], ids, _closest(at, walls.ends[:, 0], walls.ends[:, 1])


def _closest(at: Array, start: Array, end: Array) -> Array:
    """The place (M, 2) on each wall that is nearest to a point (2,)."""
    way = end - start
    part = np.clip(((at - start) * way).sum(1) / np.maximum((way**2).sum(1), 1e-12), 0, 1)
    spots: Array = start + part[:, None] * way
    return spots
