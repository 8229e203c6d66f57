"""Distances and angles between walls and corners, of a scan or of the map, with their standard deviations."""

import re
from typing import Annotated, Literal, NamedTuple, cast

import numpy as np
from fastapi import APIRouter, Query
from pydantic import AfterValidator
from typing_extensions import TypedDict

from lidarcore import Array
from lidarcore.geometry import act
from lidarcore.mapping import measure as of_map
from lidarcore.mapping import scan_measure as of_scan
from lidarcore.mapping.measure import Feature
from lidarcore.mapping.walls import Walls

from ...errors import NotFoundError
from ...pipeline.frame import Frame
from ..problems import ProblemError, documented
from ..schemas import Pair
from .dependencies import CurrentFrame

router = APIRouter(prefix="/measure", tags=["frame"], responses=documented(404, 422, 503))

SNAP = 0.3  # m; what is farther away was not meant
MIXED = "One place is of the scan, the other of the map: give two of the scan, or two of the map."
NO_WALLS = (
    "No map is being made whose walls can be measured: set navigation.mode to slam and navigation.method to scans, and "
    "wait. A map that is kept does not say how its walls err together."
)

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


class MeasureJson(TypedDict):
    """A measurement by the main method: m and rad, one sigma; `angle` is null unless both are walls."""

    first: MeasuredFeatureJson
    second: MeasuredFeatureJson
    distance: float
    sigma: float
    angle: float | None
    angle_sigma: float | None


class _Found(NamedTuple):
    feature: Feature
    said: MeasuredFeatureJson


@router.get("", response_description="The distance, and the angle between walls")
def measure(frame: CurrentFrame, first: Place, second: Place) -> MeasureJson:
    """How far two corners or walls of the current frame, or of its map, are from each other, and how sure that is.

    From a corner to a wall: across its line; between walls: across, on the average, which says nothing of walls that
    are not about parallel: their `angle` tells. 404 if nothing is near a place, no wall has the id, or both
    places name the same thing; 422 if one is of the scan and the other of the map, which err together in ways that
    nobody knows.
    """
    if first.startswith("map-") != second.startswith("map-"):
        raise ProblemError(422, MIXED)
    a, b = (_found(frame, place) for place in (first, second))
    if a.feature == b.feature:
        raise NotFoundError("Both places are on the same wall or corner: give places on two different ones.")
    walls = a.feature.kind == b.feature.kind == "wall"
    if first.startswith("map-"):
        found = of_map.distance(_map(frame), a.feature, b.feature)
        turn = of_map.angle(_map(frame), a.feature, b.feature) if walls else None
    else:
        found = of_scan.distance(frame.main, a.feature, b.feature)
        turn = of_scan.angle(frame.main, a.feature, b.feature) if walls else None
    return {
        "first": a.said,
        "second": b.said,
        "distance": found.value,
        "sigma": found.sigma,
        "angle": turn.value if turn else None,
        "angle_sigma": turn.sigma if turn else None,
    }


def _found(frame: Frame, place: str) -> _Found:
    """The corner or wall that a place means. Raises NotFoundError."""
    _, _, id = place.partition(":")
    return _wall(_map(frame), int(id)) if id else _nearest(frame, place)


def _wall(walls: Walls, id: int) -> _Found:
    """The wall with an id. Raises NotFoundError."""
    where = np.flatnonzero(walls.ids == id)
    if not len(where):
        raise NotFoundError(
            f"The map has no wall {id} now: take an id that /walls gives. Walls that become one keep the oldest id."
        )
    x, y = walls.ends[where[0]].mean(0).tolist()
    return _Found(Feature("wall", id), {"kind": "map-wall", "id": id, "at": (x, y)})


def _nearest(frame: Frame, place: str) -> _Found:
    """The corner or wall nearest to a place. Raises NotFoundError."""
    kind, _, xy = place.partition("@")
    at = np.array([float(value) for value in xy.split(",")])
    features, ids, spots = _of_map(frame, kind, at) if kind.startswith("map-") else _of_scan(frame, kind, at)
    ways = np.hypot(*(spots - at).T)
    if not len(ways) or ways.min() > SNAP:
        raise NotFoundError(f"There is no {kind} within {SNAP} m of {xy}: give a place nearer to one.")
    nearest = int(ways.argmin())
    x, y = spots[nearest].tolist()
    return _Found(features[nearest], {"kind": cast(Kind, kind), "id": ids[nearest], "at": (x, y)})


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


def _of_map(frame: Frame, kind: str, at: Array) -> _Candidates:
    walls = _map(frame)
    if kind == "map-corner":
        numbers = list(range(len(walls.corners)))
        return [Feature("corner", i) for i in numbers], numbers, walls.corners.xy
    ids = walls.ids.tolist()
    return [Feature("wall", id) for id in ids], ids, _closest(at, walls.ends[:, 0], walls.ends[:, 1])


def _map(frame: Frame) -> Walls:
    """The walls that the frame shows. Raises NotFoundError."""
    walls = frame.picture.walls if frame.picture else None
    if not isinstance(walls, Walls):
        raise NotFoundError(NO_WALLS)
    return walls


def _closest(at: Array, start: Array, end: Array) -> Array:
    """The place (M, 2) on each wall that is nearest to a point (2,)."""
    way = end - start
    part = np.clip(((at - start) * way).sum(1) / np.maximum((way**2).sum(1), 1e-12), 0, 1)
    spots: Array = start + part[:, None] * way
    return spots
