"""A whole map as a file, out and in."""

import io
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, cast
from zipfile import ZipFile

from fastapi import APIRouter, Query, Request
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.responses import FileResponse

from app.api.dependencies import CurrentLandmarks
from app.api.examples import LANDMARK, SESSION, ok
from app.api.landmarks import MEDIA_TYPES, SessionId, chosen_map
from app.api.sessions import SessionJson
from app.problems import ProblemError, documented
from lidarcore.landmarks import export_map, export_picture

MAX_BYTES = 32 << 20  # of a map that is loaded, some 150,000 landmarks
PICTURES = {"png": "image/png", "zip": "application/zip"}

router = APIRouter(prefix="/map", tags=["landmarks"], responses=documented(422, 503))

EXAMPLE = {"format": "lidarcore landmarks", "version": 1, "unit": "m", "landmarks": [LANDMARK]}
CSV = "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind,method,count,first_seen_s,last_seen_s,id\r\n..."
FILES: dict[str, Any] = {
    "application/json": {"schema": {"type": "object", "examples": [EXAMPLE]}},
    "text/csv": {"schema": {"type": "string"}},
    "application/geo+json": {"schema": {"type": "object"}},
}


def _download_responses() -> dict[int | str, dict[str, Any]]:
    responses = ok(EXAMPLE, "The map as a file")
    others = (MEDIA_TYPES | PICTURES).values()
    responses[200]["content"] |= {kind: {} for kind in others if kind != "application/json"}
    return responses | documented(404)


@router.get("", response_class=FileResponse, responses=_download_responses())
def download(
    landmarks: CurrentLandmarks,
    session: SessionId = None,
    format: Annotated[
        Literal["json", "csv", "geojson", "png", "zip"],
        Query(description="zip: map.png and map.yaml as ROS map_server reads them; png: the picture alone"),
    ] = "json",
    resolution: Annotated[float, Query(ge=1e-3, le=1e3, description="m a pixel, of a picture")] = 0.05,
) -> FileResponse:
    """All landmarks of a session, in metres in its world frame."""
    landmark_map = chosen_map(landmarks, session)
    folder = tempfile.TemporaryDirectory(prefix="lidarcore-map-")
    try:
        path = Path(folder.name) / f"map.{format}"
        if format in PICTURES:
            export_picture(landmark_map, path.with_suffix(".png"), resolution)
        else:
            export_map(landmark_map, path)
        if format == "zip":
            _pack(path)
    except BaseException:
        folder.cleanup()
        raise
    kind, name = (MEDIA_TYPES | PICTURES)[format], f"map-{landmark_map.session}.{format}"
    return FileResponse(path, media_type=kind, filename=name, background=BackgroundTask(folder.cleanup))


@router.post(
    "",
    status_code=201,
    openapi_extra={"requestBody": {"required": True, "content": FILES}},
    responses=ok(SESSION, "The new session", 201) | documented(413),
)
async def upload(
    request: Request,
    landmarks: CurrentLandmarks,
    format: Annotated[Literal["json", "csv", "geojson"], Query(description="of the body")] = "json",
    name: Annotated[
        str, Query(min_length=1, max_length=200, description="what the session is said to come from")
    ] = "a file",
) -> SessionJson:
    """Load a map: the body is a file as GET gives it. It becomes a session of its own if all of it makes sense."""
    if not name.isprintable():
        raise ProblemError(422, f"name is {name!r}: give printable text.")
    file = io.BytesIO()
    async for chunk in request.stream():
        if file.tell() + len(chunk) > MAX_BYTES:
            raise ProblemError(413, f"The map is larger than {MAX_BYTES} bytes.")
        file.write(chunk)
    file.seek(0)
    session = await run_in_threadpool(landmarks.load, file, format, name)
    return cast(SessionJson, asdict(session))


def _pack(path: Path) -> None:
    """Put the picture and what says where it is into one file."""
    with ZipFile(path, "w") as archive:
        for part in (path.with_suffix(".png"), path.with_suffix(".yaml")):
            archive.write(part, part.name)
