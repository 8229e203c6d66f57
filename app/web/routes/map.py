"""A whole map as a file, out and in."""

import tempfile
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal
from zipfile import ZipFile

import anyio
import numpy as np
from fastapi import APIRouter, Query, Request
from PIL import Image
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.responses import FileResponse

from lidarcore.landmarks import LandmarkMap, Session, export_map, export_picture
from lidarcore.mapping.export import corner_places, plan_dxf, plan_svg, write_map
from lidarcore.mapping.grid import OccupancyGrid, shades_of, write_ros_map
from lidarcore.mapping.walls import WallTable

from ...errors import NotFoundError
from ...jobs.maps.names import called, stem_of
from ...jobs.maps.store import LandmarkStore
from ..dependencies import Server
from ..openapi import MEDIA_TYPES, example, formats
from ..problems import ProblemError, documented
from .landmarks import SessionId, chosen_map

MAX_BYTES = 32 << 20  # of a map that is loaded, some 150,000 landmarks
RESOLUTION = 0.05  # m a pixel of a picture of landmarks, if nobody says another one
MOST_PIXELS = 16_000_000  # of a picture: 200 m by 200 m at 5 cm, and 32 MB while it is packed
PICTURES = ("png", "zip")
PLANS = {"svg": plan_svg, "dxf": plan_dxf}

router = APIRouter(prefix="/map", tags=["landmarks"], responses=documented(422, 503))

EXAMPLE = {"format": "lidarcore landmarks", "version": 1, "unit": "m", "landmarks": [example("Landmark")]}
CSV = "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind,method,count,first_seen_s,last_seen_s,id\r\n..."
FILES: dict[str, Any] = {
    "application/json": {"schema": {"type": "object", "examples": [EXAMPLE]}},
    "text/csv": {"schema": {"type": "string"}},
    "application/geo+json": {"schema": {"type": "object"}},
    "application/zip": {"schema": {"type": "string", "format": "binary"}},
}


@router.get(
    "",
    response_class=FileResponse,
    response_description="The map as a file",
    responses=formats(
        json=EXAMPLE,
        csv=CSV,
        geojson={"type": "FeatureCollection"},
        png="...",
        svg="...",
        dxf="...",
        zip="...",
    )
    | documented(404),
)
async def download(
    server: Server,
    session: SessionId = None,
    format: Annotated[
        Literal["json", "csv", "geojson", "png", "svg", "dxf", "zip"],
        Query(
            description="zip: image and map.yaml as ROS map_server reads them, and its walls as files; png: the "
            "picture alone; "
            "svg, dxf: the floor plan of its walls, in m"
        ),
    ] = "json",
    resolution: Annotated[
        float | None,
        Query(
            ge=1e-3,
            le=1e3,
            description="m a pixel, of a picture; if not given, that of the grid, or for landmarks "
            f"{RESOLUTION}. A grid is drawn with as many whole cells a pixel as come nearest to it",
        ),
    ] = None,
) -> FileResponse:
    """All landmarks of a session, in metres in its world frame. Made for one request at a time: others wait.

    The file is named after the session: hall.zip, or map-3.zip without a name. If it has an occupancy grid, the picture
    is of that. Walls are those that three scans of the map saw; all walls of a map that was made of a recording, and
    the poses of all its scans, are in the zip at /map/making/files.

    404 if there are no walls to draw a floor plan of, or a map of whole scans has no landmarks; 422 if a resolution is
    given for anything but a picture, or the grid is coarser.
    """
    if resolution is not None and format not in PICTURES:
        raise ProblemError(422, f"resolution is that of a picture, png or zip: leave it out for {format}.")
    make = partial(_file, server.landmarks, session, format, resolution)
    return await anyio.to_thread.run_sync(make, limiter=server.heavy)


@router.post(
    "",
    status_code=201,
    openapi_extra={"requestBody": {"required": True, "content": FILES}},
    response_description="The new session",
    responses=documented(413),
)
async def upload(
    server: Server,
    request: Request,
    format: Annotated[
        Literal["json", "csv", "geojson", "zip"] | None,
        Query(
            description="of the body, by its Content-Type or else JSON if not given; zip: a grid, map.yaml with its "
            "image as ROS and `lidarcore map` write them, and walls.csv and walls_covariance.bin if they are there"
        ),
    ] = None,
    name: Annotated[
        str, Query(min_length=1, max_length=200, description="what the session is said to come from")
    ] = "a file",
) -> Session:
    """Load a map: the body is a file as GET gives it, or a grid of ROS. It becomes a session if all of it makes sense.

    What has a grid is localized in by whole scans, other maps by their landmarks.
    """
    if not name.isprintable():
        raise ProblemError(422, f"name is {name!r}: give printable text.")
    sent = format or _format_of(request)
    with tempfile.TemporaryDirectory(prefix="lidarcore-map-") as folder:
        path = Path(folder) / f"map.{sent}"
        with path.open("xb") as file:
            async for chunk in request.stream():
                if file.tell() + len(chunk) > MAX_BYTES:
                    raise ProblemError(413, f"The map is larger than {MAX_BYTES} bytes.")
                file.write(chunk)
        return await run_in_threadpool(server.landmarks.load, path, sent, name)


def _format_of(request: Request) -> str:
    """The format that the body is declared to have: one of FILES, JSON if it is none of them."""
    declared = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return next((name for name, type_ in MEDIA_TYPES.items() if type_ == declared and type_ in FILES), "json")


def _file(
    landmarks: LandmarkStore, session: int | None, format: str, resolution: float | None
) -> FileResponse:
    landmark_map = chosen_map(landmarks, session)
    folder = tempfile.TemporaryDirectory(prefix="lidarcore-map-")
    try:
        path = Path(folder.name) / f"map.{format}"
        _write(landmarks, landmark_map, path, resolution)
    except BaseException:
        folder.cleanup()
        raise
    name = f"{stem_of(landmarks.atlas, landmark_map.session)}.{format}"
    cleanup = BackgroundTask(folder.cleanup)
    return FileResponse(path, media_type=MEDIA_TYPES[format], filename=name, background=cleanup)


def _write(landmarks: LandmarkStore, landmark_map: LandmarkMap, path: Path, resolution: float | None) -> None:
    """The file of a map, in the format that its suffix says."""
    session, format = landmark_map.session, path.suffix.removeprefix(".")
    if format in PLANS:
        path.write_text(_plan(landmarks.walls(session), landmarks.atlas.session(session), format), "utf-8")
    elif format in PICTURES:
        joint = landmarks.joint_walls(session) if format == "zip" else None
        walls = landmarks.walls(session) if joint is None else joint
        _draw(landmark_map, landmarks.grid(session), walls, path, resolution)
    else:
        _check_landmarks(landmarks.atlas.session(session))
        export_map(landmark_map, path)


def _draw(
    landmark_map: LandmarkMap,
    grid: OccupancyGrid | None,
    walls: WallTable,
    path: Path,
    resolution: float | None,
) -> None:
    """The picture of a map, or a zip of it, of what says where it is, and of its walls if there are any."""
    if grid is None:
        export_picture(landmark_map, path.with_suffix(".png"), resolution or RESOLUTION, MOST_PIXELS)
    elif path.suffix == ".zip" and len(walls):
        write_map(path.parent, _in_pixels(grid, resolution), walls)
    elif path.suffix == ".zip":
        write_ros_map(_in_pixels(grid, resolution), path.with_suffix(".yaml"))
    else:
        Image.fromarray(shades_of(_in_pixels(grid, resolution))).save(path)
    if path.suffix == ".zip":
        _pack(path)


def _in_pixels(grid: OccupancyGrid, resolution: float | None) -> OccupancyGrid:
    """The grid in cells of about a resolution, m. Raises ProblemError if its own are larger."""
    cells = 1 if resolution is None else round(resolution / grid.resolution)
    if cells < 1:
        raise ProblemError(
            422,
            f"The grid has cells of {grid.resolution:g} m, larger than {resolution:g} m: raise resolution.",
        )
    return grid.coarser(cells)


def _check_landmarks(session: Session) -> None:
    """Raises NotFoundError, which says where it is, if the map is one of whole scans."""
    grid = "a grid, in the formats png and zip" if session.grid else ""
    walls = f"walls, in the formats svg and dxf and at /walls?session={session.id}" if session.walls else ""
    if not session.landmarks and (grid or walls):
        has = ", and ".join(filter(None, (grid, walls)))
        raise NotFoundError(f"{called(session)} has no landmarks. It has {has}.")


def _plan(walls: WallTable, session: Session, format: str) -> str:
    if not len(walls):
        raise NotFoundError(f"{called(session)} has no walls: no floor plan can be drawn of it.")
    return PLANS[format](walls.ends, corner_places(walls), np.empty((0, 2)))


def _pack(path: Path) -> None:
    """Put the picture and what says where it is into one file."""
    with ZipFile(path, "w") as archive:
        for part in sorted(path.parent.iterdir()):
            if part != path:
                archive.write(part, part.name)
