"""The building as SLAM from whole scans has it now: walls, and which parts are occupied and free."""

import io
import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal
from zipfile import ZipFile

import anyio
import numpy as np
from fastapi import APIRouter, Depends, Query
from numpy.typing import NDArray
from PIL import Image
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.landmarks import Box, Circle
from lidarcore.mapping import MapPicture
from lidarcore.mapping.export import MAP_FILES, walls_csv, walls_geojson, write_map
from lidarcore.mapping.grid import OccupancyGrid, shades_of
from lidarcore.mapping.walls import Walls, WallTable, along, distances, in_box, nearest

from ...errors import NotFoundError
from ...jobs.wall_writer import from_stored
from ...pipeline.runtime import Runtime
from ..problems import ProblemError, documented, encode
from ..schemas import Finite
from ..wall_json import WallJson, wall_rows
from .dependencies import CurrentLandmarks, CurrentRuntime, Heavy
from .examples import MEDIA_TYPES, ok
from .landmarks import USUAL, Limit, Metres, Region

Mask = NDArray[np.bool_]

router = APIRouter(tags=["localization"], responses=documented(404, 422))

NO_BUILDING = 'There is no map of whole scans: set navigation.mode to slam and navigation.method to "scans".'
NO_SESSION = "No map is kept yet: wait for further scans, or give the session of one that is kept."
NOT_YET = "The map of whole scans has no {} yet: wait for further scans."

WALL = {
    "id": 0, "alpha": 0.0021, "r": 3.1007, "covariance": [[1.2e-06, 3.1e-07], [3.1e-07, 8.4e-06]],
    "start": [3.1049, -1.9012], "end": [3.0965, 1.9866], "length": 3.8878, "length_variance": 2.1e-05,
    "ended": [True, False], "in_corner": [True, False],
    "first_seen": 1795255000.1, "last_seen": 1795255031.4, "count": 41,
}  # fmt: skip
CSV = "id,alpha_rad,r_m,x1_m,y1_m,x2_m,y2_m,length_m,..."


class WallsJson(TypedDict):
    walls: list[WallJson]


class WallHistoryJson(TypedDict):
    """`wall` is null if it is no longer in the map: its last state is the last of the history."""

    session: int
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
    tolerance: Annotated[float, Query(ge=0, le=1.6, description="rad that the direction may be off")] = 0.1,
) -> Callable[[WallTable], Mask]:
    """Which walls count. Raises ProblemError 422 if the lengths are exchanged."""
    if min_length > max_length:
        raise ProblemError(
            422, f"min_length ({min_length:g} m) is above max_length ({max_length:g} m): swap them."
        )

    def which(walls: WallTable) -> Mask:
        kept: Mask = (walls.length >= min_length) & (walls.length <= max_length)
        return kept if direction is None else kept & along(walls, direction, tolerance)

    return which


def _asked(
    runtime: CurrentRuntime,
    landmarks: CurrentLandmarks,
    session: Annotated[
        int | None, Query(description="of a map that is kept; if not given of the one that SLAM makes now")
    ] = None,
) -> WallTable:
    return _walls(runtime) if session is None else landmarks.walls(session)


Asked = Annotated[WallTable, Depends(_asked)]
Which = Annotated[Callable[[WallTable], Mask], Depends(_wanted)]


@router.get(
    "/walls",
    response_model=WallsJson,
    responses=ok({"walls": [WALL]}, "The walls", csv=CSV, geojson={"type": "FeatureCollection"}),
)
def walls(
    asked: Asked,
    region: Region,
    which: Which,
    format: Annotated[
        Literal["json", "csv", "geojson"], Query(description="m, rad, s in all of them")
    ] = "json",
) -> Response:
    """The walls of the map that SLAM makes of whole scans, all or those asked for. 404 if it makes none.

    A wall is in a box or circle if any part of it is. Kept with a session are those that three keyframes saw or more.
    """
    chosen = np.flatnonzero(which(asked) & _within(asked, region)).tolist()
    if format == "json":
        return encode({"walls": wall_rows(asked, chosen)})
    text = walls_csv(asked, chosen) if format == "csv" else walls_geojson(asked, chosen)
    return Response(text, media_type=MEDIA_TYPES[format])


@router.get(
    "/walls/nearest",
    response_model=NearestWallsJson,
    responses=ok({"walls": [WALL], "distances": [0.412]}, "The nearest first"),
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
    responses=ok({"session": 3, "wall": WALL, "history": [WALL], "next": None}, "The wall") | documented(503),
)
def history(
    landmarks: CurrentLandmarks,
    id: int,
    after: Annotated[Finite, Query(description="s: `next` of the page before")] = -math.inf,
    limit: Limit = USUAL,
    session: Annotated[
        int | None, Query(description="which map; if not given the one that is written or used")
    ] = None,
) -> Response:
    """One wall of a map that is kept, and what it was in each second in which it was seen, the oldest first.

    So also of one that became part of another. It begins when three keyframes have seen the wall; 404 until then.
    """
    session = landmarks.session if session is None else session
    if session is None:
        raise NotFoundError(NO_SESSION)
    wall_map = landmarks.atlas[session]
    found = from_stored(wall_map.wall_history(id, after, limit))
    present = from_stored([wall for wall in wall_map.walls() if wall.id == id])
    return encode(
        {
            "session": session,
            "wall": next(iter(wall_rows(present, range(len(present)))), None),
            "history": wall_rows(found, range(len(found))),
            "next": float(found.last_seen[-1]) if len(found) == limit else None,
        }
    )


@router.get(
    "/map/grid",
    response_class=Response,
    responses={200: {"description": "The map", "content": {"image/png": {}, "application/zip": {}}}},
)
async def grid(
    runtime: CurrentRuntime,
    heavy: Heavy,
    format: Annotated[
        Literal["png", "zip"], Query(description="the grid as a picture, or all files of `lidarcore map`")
    ] = "png",
) -> Response:
    """The map that SLAM makes of whole scans, as a picture of its occupancy grid or as files for other programs.

    png: black occupied, white free, grey unknown, y up. Its headers say where it lies: Grid-Resolution is the side of a
    pixel in m, Grid-Origin x (m), y (m) and heading (rad) of its lower left corner in the frame of the map.
    zip: map.pgm and map.yaml as ROS map_server reads them, the walls as CSV and GeoJSON, the plan as SVG and DXF.
    404 if SLAM makes no map of whole scans, or has no walls yet.
    """
    found = _picture(runtime).grid
    make = partial(_zip, found, _walls(runtime)) if format == "zip" else partial(_grid_png, found)
    return await anyio.to_thread.run_sync(make, limiter=heavy)


def _zip(grid: OccupancyGrid, walls: Walls) -> Response:
    file = io.BytesIO()
    with tempfile.TemporaryDirectory(prefix="lidarcore-map-") as folder, ZipFile(file, "w") as archive:
        write_map(folder, grid, walls)
        for name in MAP_FILES:
            archive.write(Path(folder) / name, name)
    return Response(file.getvalue(), media_type=MEDIA_TYPES["zip"])


def _grid_png(found: OccupancyGrid) -> Response:
    file = io.BytesIO()
    Image.fromarray(shades_of(found)).save(file, "PNG")
    place = {
        "Grid-Resolution": f"{found.resolution:g}",
        "Grid-Origin": ",".join(f"{value:.9g}" for value in found.origin.tolist()),
    }
    return Response(file.getvalue(), media_type="image/png", headers=place)


def _walls(runtime: Runtime) -> Walls:
    found = _picture(runtime).walls
    if found is None:
        raise NotFoundError(NOT_YET.format("walls"))
    return found


def _within(walls: WallTable, region: Box | Circle | None) -> Mask:
    if region is None:
        return np.ones(len(walls), bool)
    if isinstance(region, Circle):
        return distances(walls, (region.x, region.y)) <= region.radius
    return in_box(walls, (region.x_min, region.y_min), (region.x_max, region.y_max))


def _picture(runtime: Runtime) -> MapPicture:
    wanted, found = runtime.settings.navigation, runtime.navigation.picture
    if found is not None:
        return found
    makes_one = wanted.mode == "slam" and wanted.method == "scans"
    raise NotFoundError(NOT_YET.format("grid") if makes_one else NO_BUILDING)
