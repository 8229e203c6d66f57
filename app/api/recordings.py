"""The recordings folder: list, upload, delete."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request
from typing_extensions import TypedDict

from app.api.dependencies import CurrentLibrary
from app.api.examples import RECORDING, ok
from app.library import RecordingJson
from app.problems import documented

router = APIRouter(prefix="/recordings", tags=["recordings"])

Name = Annotated[str, Path(description="a plain file name", examples=["room.bag"])]
RAW_BODY = {
    "requestBody": {"required": True, "content": {"application/octet-stream": {"schema": {"type": "string"}}}}
}


class RecordingsJson(TypedDict):
    folder: str
    max_bytes: int
    recordings: list[RecordingJson]


EXAMPLE = {"folder": "recordings", "max_bytes": 1 << 30, "recordings": [RECORDING]}


@router.get("", responses=ok(EXAMPLE, "What can be played"))
def read(library: CurrentLibrary) -> RecordingsJson:
    """What is in the recordings folder, and how large an upload may be."""
    return {"folder": str(library.folder), "max_bytes": library.max_bytes, "recordings": library.list()}


@router.put(
    "/{name:path}",
    status_code=201,
    openapi_extra=RAW_BODY,
    responses=ok(RECORDING, "Stored and readable", 201) | documented(409, 413, 422, 507),
)
async def upload(
    request: Request,
    library: CurrentLibrary,
    name: Name,
    overwrite: Annotated[bool, Query(description="replace a recording of that name")] = False,
) -> RecordingJson:
    """Upload a recording: the body is the file. It is kept if all of it arrives and a reader takes it."""
    library.check_size(int(request.headers.get("content-length", 0)))
    return await library.add(name, request.stream(), overwrite=overwrite)


@router.delete("/{name:path}", status_code=204, responses=documented(404, 409, 422))
def delete(library: CurrentLibrary, name: Name) -> None:
    """Delete a recording. If it plays, what was read of it goes on playing."""
    library.delete(name)
