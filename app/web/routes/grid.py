"""The map of whole scans that is made, or localized in, now: the picture of its grid, or all of it as files."""

import io
import tempfile
from functools import partial
from pathlib import Path
from typing import Annotated, Literal
from zipfile import ZipFile

import anyio
from fastapi import APIRouter, Query
from PIL import Image
from starlette.responses import Response

from lidarcore.mapping import MapPicture
from lidarcore.mapping.export import write_map
from lidarcore.mapping.grid import OccupancyGrid, shades_of
from lidarcore.mapping.walls import WallTable

from ...errors import NotFoundError, NotYetError
from ...jobs.maps.names import stem_of
from ...pipeline.runtime import Runtime
from ..answers.downloads import file_of
from ..dependencies import Server
from ..problems import documented
from ..state import State

router = APIRouter(tags=["localization"], responses=documented(404, 422, 503))

NO_BUILDING = 'There is no map of whole scans: set navigation.mode to slam and navigation.method to "scans".'
NOT_YET = "The map of whole scans has no {} yet: wait for further scans."
NOT_BEGUN = "No scan has been localized yet, which tells what map there is. Ask again in a while."
NO_WALLS = "The map that the sensor is localized in has no walls: its grid alone is at /map/grid?format=png."


def running_picture(runtime: Runtime) -> MapPicture:
    """Grid and walls of the map that is made, or localized in, now. Raises NotYetError, NotFoundError."""
    wanted, navigation = runtime.settings.navigation, runtime.navigation
    if (found := navigation.picture) is not None:
        return found
    makes_one = wanted.mode == "slam" and wanted.method == "scans"
    begins = wanted.mode == "localize" and navigation.method is None and navigation.problem is None
    if not (makes_one or begins):
        raise NotFoundError(NO_BUILDING)
    runtime.newest()  # says why, if no scan was processed at all
    raise NotYetError(NOT_YET.format("grid") if makes_one else NOT_BEGUN)


def asked_session(server: State, session: int | None) -> int | None:
    """The kept map that is meant: the given one, else that which is localized in; None for that which is made."""
    if session is None and server.runtime.settings.navigation.mode == "localize":
        return server.runtime.navigation.session
    return session


def running_walls(runtime: Runtime) -> WallTable:
    """The walls of the map that is made, or localized in, now. Raises NotYetError, NotFoundError."""
    found = running_picture(runtime).walls
    if found is not None:
        return found
    if runtime.settings.navigation.mode == "slam":
        raise NotYetError(NOT_YET.format("walls"))
    raise NotFoundError(NO_WALLS)


@router.get(
    "/map/grid",
    response_class=Response,
    responses={200: {"description": "The map", "content": {"image/png": {}, "application/zip": {}}}},
)
async def grid(
    server: Server,
    format: Annotated[
        Literal["png", "zip"], Query(description="the grid as a picture, or it and the walls as files")
    ] = "png",
) -> Response:
    """The map of whole scans that SLAM makes, or that is localized in: its grid as a picture, or all of it as files.

    png: black occupied, white free, grey unknown, y up. Its headers say where it lies: Grid-Resolution is the side of a
    pixel in m, Grid-Origin x (m), y (m) and heading (rad) of its lower left corner in the frame of the map.
    zip: map.pgm and map.yaml as ROS map_server reads them, the walls as CSV and GeoJSON, the plan as SVG and DXF, the
    picture with its walls; poses are at /trajectory. It is named after the map that is localized in, or map.zip.
    404 if there is no such map, or it has no walls; 503 if it has none yet: until the first scan was mapped.
    """
    found = running_picture(server.runtime).grid
    make = partial(_grid_png, found)
    if format == "zip":
        kept = asked_session(server, None)
        stem = "map" if kept is None else stem_of(server.landmarks.atlas, kept)
        make = partial(_zip, found, running_walls(server.runtime), stem)
    return await anyio.to_thread.run_sync(make, limiter=server.heavy)


def _zip(grid: OccupancyGrid, walls: WallTable, stem: str) -> Response:
    file = io.BytesIO()
    with tempfile.TemporaryDirectory(prefix="lidarcore-map-") as folder, ZipFile(file, "w") as archive:
        write_map(folder, grid, walls)
        for part in sorted(Path(folder).iterdir()):
            archive.write(part, part.name)
    return file_of(file.getvalue(), "zip", stem)


def _grid_png(found: OccupancyGrid) -> Response:
    file = io.BytesIO()
    Image.fromarray(shades_of(found)).save(file, "PNG")
    place = {
        "Grid-Resolution": f"{found.resolution:g}",
        "Grid-Origin": ",".join(f"{value:.9g}" for value in found.origin.tolist()),
    }
    return Response(file.getvalue(), media_type="image/png", headers=place)
