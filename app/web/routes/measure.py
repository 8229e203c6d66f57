"""Distances and angles between what a scan shows, with their standard deviations."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from fastapi import APIRouter, Query
from typing_extensions import TypedDict

from lidarcore import Array
from lidarcore.geometry import act
from lidarcore.mapping.measure import Feature
from lidarcore.mapping.scan_measure import angle, distance

from ...errors import NotFoundError
from ...pipeline.frame import Frame
from ..problems import documented
from ..schemas import Pair
from .dependencies import CurrentFrame
from .examples import ok

router = APIRouter(prefix="/measure", tags=["frame"], responses=documented(404, 422))

SNAP = 0.3  # m; what is farther away was not meant

Place = Annotated[
    str,
    Query(
        pattern=r"^(corner|wall)@-?\d{1,6}(\.\d{1,12})?,-?\d{1,6}(\.\d{1,12})?$",
        description="corner@x,y or wall@x,y: the nearest one to a place, m, in the frame of the map or of the sensor",
        examples=["corner@3.1,1.99"],
    ),
]


class MeasuredFeatureJson(TypedDict):
    """`id` of a corner as frames have it, of a wall its number in this frame; `at`, the place on it, m."""

    kind: Literal["corner", "wall"]
    id: int
    at: Pair


class MeasureJson(TypedDict):
    """By the main method: m and rad, one sigma; `angle` is null unless both are walls."""

    first: MeasuredFeatureJson
    second: MeasuredFeatureJson
    distance: float
    sigma: float
    angle: float | None
    angle_sigma: float | None


EXAMPLE = {
    "first": {"kind": "corner", "id": 12, "at": [3.1042, 1.9873]},
    "second": {"kind": "wall", "id": 4, "at": [-0.3081, 1.9544]},
    "distance": 3.4123, "sigma": 0.0091, "angle": None, "angle_sigma": None,
}  # fmt: skip


class _Found(NamedTuple):
    feature: Feature
    said: MeasuredFeatureJson


@router.get("", responses=ok(EXAMPLE, "The distance, and the angle between walls"))
def measure(frame: CurrentFrame, first: Place, second: Place) -> MeasureJson:
    """How far two corners or walls of the current frame are from each other, and how sure that is.

    From a corner to a wall: across its line; between walls: across, on the average. 404 if nothing is near a place, or
    both places name the same thing.
    """
    a, b = (_nearest(frame, place) for place in (first, second))
    if a.feature == b.feature:
        raise NotFoundError("Both places are at the same thing: give places at two.")
    found = distance(frame.main, a.feature, b.feature)
    walls = a.feature.kind == b.feature.kind == "wall"
    turn = angle(frame.main, a.feature, b.feature) if walls else None
    return {
        "first": a.said,
        "second": b.said,
        "distance": found.value,
        "sigma": found.sigma,
        "angle": turn.value if turn else None,
        "angle_sigma": turn.sigma if turn else None,
    }


def _nearest(frame: Frame, place: str) -> _Found:
    """The corner or wall of the main method that a place means. Raises NotFoundError."""
    kind, _, xy = place.partition("@")
    at = np.array([float(value) for value in xy.split(",")])
    if kind == "corner":
        main = next(iter(frame.features))
        ids = {row.index[main]: row.id for row in frame.corners if main in row.index}
        spots = act(frame.pose, frame.main.corners.xy)
    else:
        ids = {i: i for i in range(len(frame.main.segments))}
        start, end = (act(frame.pose, p) for p in (frame.main.segments.start, frame.main.segments.end))
        spots = _closest(at, start, end)
    ways = np.hypot(*(spots - at).T)
    if not len(ways) or ways.min() > SNAP:
        raise NotFoundError(f"There is no {kind} within {SNAP} m of {xy}: give a place at one of the frame.")
    index = int(ways.argmin())
    x, y = spots[index].tolist()
    return _Found(
        Feature("corner" if kind == "corner" else "wall", index),
        {"kind": "corner" if kind == "corner" else "wall", "id": ids[index], "at": (x, y)},
    )


def _closest(at: Array, start: Array, end: Array) -> Array:
    """The place (M, 2) on each wall that is nearest to a point (2,)."""
    way = end - start
    part = np.clip(((at - start) * way).sum(1) / np.maximum((way**2).sum(1), 1e-12), 0, 1)
    spots: Array = start + part[:, None] * way
    return spots
