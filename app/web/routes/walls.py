"""Walls of maps of whole scans: of the one that SLAM makes now, and of those that are kept."""

import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Depends, Query
from numpy.typing import NDArray
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.errors import UnknownWallError
from lidarcore.landmarks import Box, Circle
from lidarcore.mapping.export import walls_csv, walls_geojson
from lidarcore.mapping.walls import WallTable, along, distances, in_box, nearest

from ...errors import NotFoundError
from ...jobs.maps.names import stem_of
from ...jobs.maps.store import LandmarkStore
from ...jobs.maps.wall_writer import from_stored
from ...pipeline.runtime import Runtime
from ..dependencies import Server
from ..downloads import text_file
from ..map_queries import USUAL, Limit, Metres, Region
from ..openapi import formats
from ..problems import ProblemError, documented, encode
from ..schemas import Finite
from ..wall_json import WallJson, wall_rows
from .grid import asked_session, running_walls

Mask = NDArray[np.bool_]

router = APIRouter(tags=["localization"], responses=documented(404, 422, 503))

NO_SESSION = "No map is kept yet: wait for further scans, or give the session of one that is kept."

TOLERANCE = 0.1  # rad that a direction may be off, if nobody says

CSV = "id,alpha_rad,r_m,x1_m,y1_m,x2_m,y2_m,length_m,..."


class WallsJson(TypedDict):
    walls: list[WallJson]


class WallHistoryJson(TypedDict):
    """`wall` is null if it is no longer in the map: its last state is the last of the history.

    `session` is null, and the history empty, of a wall of the running map before anything of it is kept.
    """

    session: int | None
    wall: WallJson | None
    history: list[WallJson]
    next: float | None


class NearestWallsJson(TypedDict):
    """`distances` m, of each wall from the point."""

    walls: list[WallJson]
    distances: list[float]


async def _wanted(
    min_length: Annotated[Finite, Query(ge=0, description="m")] = 0.0,
    max_length: Annotated[Finite, Query(ge=0, description="m")] = math.inf,
    direction: Annotated[
        float | None, Query(ge=-7, le=7, description="rad from the x axis; a wall runs both ways")
    ] = None,
    tolerance: Annotated[
        float | None,
        Query(ge=0, le=1.6, description=f"rad that the direction may be off; {TOLERANCE} if not given"),
    ] = None,
) -> Callable[[WallTable], Mask]:
    """Which walls count. Raises ProblemError 422 if the lengths are exchanged, or tolerance is that of no direction."""
    if min_length > max_length:
        raise ProblemError(
            422, f"min_length ({min_length:g} m) is above max_length ({max_length:g} m): swap them."
        )
    if direction is None and tolerance is not None:
        raise ProblemError(
            422, "tolerance says how far a direction may be off: give direction, too, or leave it out."
        )

    off = TOLERANCE if tolerance is None else tolerance

    def which(walls: WallTable) -> Mask:
        kept: Mask = (walls.length >= min_length) & (walls.length <= max_length)
        return kept if direction is None else kept & along(walls, direction, off)

    return which


def _kept(
    server: Server,
    session: Annotated[
        int | None,
        Query(
            description="of a map that is kept; if not given of the one that is made, or localized in, now"
        ),
    ] = None,
) -> int | None:
    return asked_session(server, session)


Kept = Annotated[int | None, Depends(_kept)]


def _asked(server: Server, kept: Kept) -> WallTable:
    return running_walls(server.runtime) if kept is None else server.landmarks.walls(kept)


Asked = Annotated[WallTable, Depends(_asked)]
Which = Annotated[Callable[[WallTable], Mask], Depends(_wanted)]


@router.get(
    "/walls",
    response_model=WallsJson,
    response_description="The walls",
    responses=formats(csv=CSV, geojson={"type": "FeatureCollection"}),
)
def walls(
    server: Server,
    kept: Kept,
    asked: Asked,
    region: Region,
    which: Which,
    format: Annotated[
        Literal["json", "csv", "geojson"], Query(description="m, rad, s in all of them")
    ] = "json",
) -> Response:
    """The walls of the map that SLAM makes of whole scans, or that the sensor is localized in; all or those asked for.

    404 if there is no such map; 503 until the first scan was mapped.

    A wall is in a box or circle if any part of it is. With a session those are kept that three scans of the map saw.
    """
    chosen = np.flatnonzero(which(asked) & _within(asked, region)).tolist()
    if format == "json":
        return encode({"walls": wall_rows(asked, chosen)})
    text = walls_csv(asked, chosen) if format == "csv" else walls_geojson(asked, chosen)
    return text_file(
        text, format, "walls" if kept is None else f"{stem_of(server.landmarks.atlas, kept)}-walls"
    )


@router.get(
    "/walls/nearest",
    response_model=NearestWallsJson,
    response_description="The nearest first",
)
def nearest_walls(
    asked: Asked,
    which: Which,
    x: Annotated[Metres, Query(description="m", examples=[1.0])],
    y: Annotated[Metres, Query(description="m", examples=[0.5])],
    k: Annotated[int, Query(ge=1, le=10_000, description="how many")] = 1,
) -> Response:
    """The k walls nearest to a point, and how far from it they are between their ends. 404 if there is no map."""
    wanted, far = which(asked), distances(asked, (x, y))
    chosen = [i for i in nearest(asked, (x, y), len(asked)).tolist() if wanted[i]][:k]
    return encode({"walls": wall_rows(asked, chosen), "distances": far[chosen].tolist()})


@router.get(
    "/walls/{id}/history",
    response_model=WallHistoryJson,
    response_description="The wall",
)
def history(
    server: Server,
    id: int,
    after: Annotated[Finite, Query(description="s: `next` of the page before")] = -math.inf,
    limit: Limit = USUAL,
    session: Annotated[
        int | None, Query(description="which map; if not given the one that is written or used")
    ] = None,
) -> Response:
    """One wall of a map that is kept, and what it was in each second in which it was seen, the oldest first.

    So also of one that became part of another. It begins when three keyframes have seen the wall; of a wall of the
    running map it is empty until then.
    """
    kept = server.landmarks.session if session is None else session
    try:
        return encode(_kept_history(server.landmarks, kept, id, after, limit))
    except (NotFoundError, UnknownWallError):
        wall = _running_wall(server.runtime, id) if session is None else None
        if wall is None:
            raise
        return encode({"session": kept, "wall": wall, "history": [], "next": None})


def _kept_history(
    landmarks: LandmarkStore, session: int | None, id: int, after: float, limit: int
) -> WallHistoryJson:
    if session is None:
        raise NotFoundError(NO_SESSION)
    wall_map = landmarks.atlas[session]
    found = from_stored(wall_map.wall_history(id, after, limit))
    present = from_stored([wall for wall in wall_map.walls() if wall.id == id])
    return {
        "session": session,
        "wall": next(iter(wall_rows(present, range(len(present)))), None),
        "history": wall_rows(found, range(len(found))),
        "next": float(found.last_seen[-1]) if len(found) == limit else None,
    }


def _running_wall(runtime: Runtime, id: int) -> WallJson | None:
    """A wall of the map that SLAM makes now."""
    picture = runtime.navigation.picture
    if picture is None or picture.walls is None:
        return None
    return next(iter(wall_rows(picture.walls, np.flatnonzero(picture.walls.ids == id).tolist())), None)


def _within(walls: WallTable, region: Box | Circle | None) -> Mask:
    if region is None:
        return np.ones(len(walls), bool)
    if isinstance(region, Circle):
        return distances(walls, (region.x, region.y)) <= region.radius
    return in_box(walls, (region.x_min, region.y_min), (region.x_max, region.y_max))
