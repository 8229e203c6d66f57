"""Finished maps of recordings, made beside what plays."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Query
from pydantic import Field
from starlette.responses import FileResponse
from typing_extensions import TypedDict

from lidarcore import RecordingError, TopicError

from ...jobs.maps.making import MakingStatus
from ...sources.recording_facts import RecordingFacts
from ..dependencies import Server
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(prefix="/map/making", tags=["landmarks"])


class MakingJson(TypedDict):
    """`making` is made, or was made last; `waiting` come next, in their order.

    `ended`, the last one last, are the last 8 that are finished, and the last 8 that failed or were cancelled.
    """

    making: MakingStatus | None
    waiting: list[MakingStatus]
    ended: list[MakingStatus]


Id = Annotated[int | None, Query(description="of one that POST has answered with")]
ZIP: dict[int | str, dict[str, Any]] = {200: {"description": "The files", "content": {"application/zip": {}}}}


class WantedMap(StrictBody):
    """A recording of the folder, and which lidar if it has several; the only one need not be named."""

    recording: Annotated[str, Field(max_length=200)]
    topic: Annotated[str | None, Field(max_length=200)] = None


@router.post("", response_description="What is made, or waits", responses=documented(404, 409, 422, 507))
def start(
    server: Server, wanted: Annotated[WantedMap, Body(examples=[{"recording": "hall.mcap"}])]
) -> MakingStatus:
    """Make a map of a whole recording, as `lidarcore map` does, with the noise, walls and mask that are set now.

    Loops are sought once more and all scans adjusted at once when it is finished, which no map that grows beside the
    sensor is. It becomes a session, as other maps do. One at a time, in a process of its own that gives way to others:
    up to 8 wait meanwhile. The files of the last 8 that are finished, some MB each, stay until the server ends; the
    maps stay longer.
    """
    path = server.library.path(wanted.recording)
    facts = server.library.facts(wanted.recording)
    topic = _lidar(path.name, facts, wanted.topic)
    return server.map_maker.start(path, topic, facts.scans, server.runtime.settings)


def _lidar(recording: str, facts: RecordingFacts, wanted: str | None) -> str | None:
    """The name of the lidar that is wanted, or of the only one; None where the format names none.

    Raises TopicError if it is not there or has to be chosen, RecordingError if the recording cannot be read.
    """
    are_several = len(facts.topics) > 1
    if facts.problem and not are_several:
        raise RecordingError(facts.problem)
    if not wanted and are_several:
        raise TopicError(str(facts.problem), facts.topics)
    if wanted and wanted not in facts.topics:
        listed = (
            f"choose {' or '.join(facts.topics)}" if facts.topics else "its format names none, leave it out"
        )
        raise TopicError(f"{recording} has no lidar {wanted!r}: {listed}.", facts.topics)
    return wanted or next(iter(facts.topics), None)


@router.get("", response_description="What is made, or was made last, and what waits")
def read(server: Server) -> MakingJson:
    """How far the map of a recording is; null if none was made since the server started."""
    making, waiting, ended = server.map_maker.status()
    return {"making": making, "waiting": waiting, "ended": ended}


@router.delete("", status_code=204, responses=documented(404))
def cancel(server: Server, id: Id = None) -> None:
    """Make that map no further, the one that is made if no id is given; nothing of it stays, and the next begins."""
    server.map_maker.cancel(id)


@router.get(
    "/files",
    response_class=FileResponse,
    responses=ZIP | documented(404),
)
def files(server: Server, id: Id = None) -> FileResponse:
    """A zip of all files of the map that was made last, or of another: as /map gives it, and poses.csv of all scans.

    The poses have covariances, and the walls are all of them, where /map gives those alone that three scans saw. The
    file is named after the session: hall-with-poses.zip, or map-3-with-poses.zip without a name.
    """
    path, name = server.map_maker.files(id)
    return FileResponse(path, media_type="application/zip", filename=name)
