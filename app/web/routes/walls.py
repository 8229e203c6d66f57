"""Walls of maps of whole scans: of the one that SLAM makes now, and of those that are kept."""

import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Depends, Query
from numpy.typing import NDArray
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.landmarks import Box, Circle
from lidarcore.mapping.export import walls_csv, walls_geojson
from lidarcore.mapping.walls import WallTable, along, distances, in_box, nearest

from ...jobs.maps.names import stem_of
from ..answers.downloads import file_of
from ..answers.wall_json import WallJson, wall_rows
from ..dependencies import Server
from ..openapi import formats
from ..problems import ProblemError, documented, encode
from ..requests.map_queries import Metres, Region
from ..schemas import Finite
from .grid import asked_session, running_walls

Mask = NDArray[np.bool_]

router = APIRouter(tags=["localization"], responses=documented(404, 422, 503))

TOLERANCE = 0.1  # rad that a direction may be off, if nobody says

CSV = "id,alpha_rad,r_m,x1_m,y1_m,x2_m,y2_m,length_m,..."


class WallsJson(TypedDict):
    walls: list[WallJson]


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
    return file_of(
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


def _within(walls: WallTable, region: Box | Circle | None) -> Mask:
    if region is None:
        return np.ones(len(walls), bool)
    if isinstance(region, Circle):
        return distances(walls, (region.x, region.y)) <= region.radius
    return in_box(walls, (region.x_min, region.y_min), (region.x_max, region.y_max))
