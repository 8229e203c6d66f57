"""The recordings folder: list, upload, download, rename, delete and take back."""

from typing import Annotated

from fastapi import APIRouter, Body, Path, Query, Request
from pydantic import Field
from starlette.responses import FileResponse
from typing_extensions import TypedDict

from ...sources.library import RecordingEntry
from ...sources.recording_facts import RecordingFacts
from ..dependencies import Server
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(prefix="/recordings", tags=["recordings"])

Name = Annotated[str, Path(description="a plain file name", examples=["room.bag"])]
RAW_BODY = {
    "requestBody": {"required": True, "content": {"application/octet-stream": {"schema": {"type": "string"}}}}
}


class NewName(StrictBody):
    """What to change of a recording."""

    name: Annotated[str, Field(description="a plain file name that is not taken")]


class RecordingsJson(TypedDict):
    """`unlisted` names files that are left out for their names, which do not work on every system: rename them."""

    folder: str
    max_bytes: int
    recordings: list[RecordingEntry]
    unlisted: list[str]
    undo_within: float


@router.get("", response_description="What can be played")
def read(server: Server) -> RecordingsJson:
    """What is in the recordings folder, how large an upload may be, and for how long (s) a deletion can be undone."""
    return {
        "folder": str(server.library.folder),
        "max_bytes": server.library.max_bytes,
        "recordings": server.library.list(),
        "unlisted": list(server.library.unlisted()),
        "undo_within": server.library.trash.undo_within,
    }


@router.get("/{name}/facts", response_description="What it holds", responses=documented(404, 422))
def facts(server: Server, name: Name) -> RecordingFacts:
    """Format, sensor, lidars, scans and duration (s): the first time, all of the recording is read for that."""
    return server.library.facts(name)


@router.post("/{name}/restore", response_description="It is back", responses=documented(404, 409, 422, 507))
def restore(server: Server, name: Name) -> RecordingEntry:
    """Take back a recording that was deleted less than `undo_within` seconds ago."""
    return server.library.restore(name)


@router.get(
    "/{name:path}",
    response_class=FileResponse,
    responses=documented(404, 409, 422)
    | {200: {"description": "The file", "content": {"application/octet-stream": {}}}},
)
def download(server: Server, name: Name) -> FileResponse:
    """The recording as a file; 409 for a bag that is a folder."""
    return FileResponse(server.library.file(name), filename=name, media_type="application/octet-stream")


@router.patch("/{name:path}", response_description="Renamed", responses=documented(404, 409, 422, 507))
def rename(
    server: Server, name: Name, change: Annotated[NewName, Body(examples=[{"name": "hall.bag"}])]
) -> RecordingEntry:
    """Give a recording another name. If it plays, it goes on playing."""
    return server.library.rename(name, change.name)


@router.put(
    "/{name:path}",
    status_code=201,
    openapi_extra=RAW_BODY,
    response_description="Stored and readable",
    responses=documented(409, 413, 422, 507),
)
async def upload(
    server: Server,
    request: Request,
    name: Name,
    overwrite: Annotated[bool, Query(description="replace a recording of that name")] = False,
) -> RecordingEntry:
    """Upload a recording: the body is the file. It is kept if all of it arrives and a reader takes it."""
    server.library.check_size(int(request.headers.get("content-length", 0)))
    return await server.library.add(name, request.stream(), overwrite=overwrite)


@router.delete("/{name:path}", status_code=204, responses=documented(404, 409, 422, 507))
def delete(server: Server, name: Name) -> None:
    """Delete a recording. If it plays, what was read of it goes on playing. It can be restored for `undo_within` s."""
    server.library.delete(name)
