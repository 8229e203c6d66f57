"""Sessions: the runs, and imported files, that have a map of their own."""

from typing import Annotated

from fastapi import APIRouter, Body, Path
from pydantic import BeforeValidator, Field
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.landmarks import MAX_NAME, Session

from ...errors import ConflictError
from ...jobs.maps.store import StoreStatus
from ..dependencies import Server
from ..problems import documented, encode
from ..schemas import StrictBody

router = APIRouter(prefix="/sessions", tags=["landmarks"], responses=documented(503))


class SessionsJson(TypedDict):
    store: StoreStatus
    sessions: list[Session]


def _given(name: object) -> object:
    if name is None:
        raise ValueError('null is no name: give "" to take the name away.')
    return name


class SessionChange(StrictBody):
    """What to change of a session."""

    name: Annotated[
        str,
        BeforeValidator(_given),
        Field(
            description="what people call it, of printable characters, without blanks around; empty takes it away",
            json_schema_extra={"maxLength": MAX_NAME},
        ),
    ]


@router.get("", response_model=SessionsJson, response_description="All sessions, the oldest first")
def read(server: Server) -> Response:
    """The maps there are, and how well the running one gets to the disk."""
    return encode({"store": server.landmarks.status, "sessions": server.landmarks.atlas.sessions()})


@router.patch("/{id}", response_description="The session", responses=documented(404, 422))
def rename(
    server: Server,
    id: Annotated[int, Path(examples=[3])],
    change: Annotated[SessionChange, Body(examples=[{"name": "Hall, ground floor"}])],
) -> Session:
    """Name a session, also while it is being written. One with a name is kept when a recording plays again."""
    server.landmarks.atlas.rename(id, change.name)
    return server.landmarks.atlas.session(id)


@router.delete("/{id}", status_code=204, responses=documented(404, 409, 422))
def delete(server: Server, id: Annotated[int, Path(examples=[3])]) -> None:
    """Delete a session with its landmarks and their history; who is localized in it is so no longer.

    409 for the one that is being written.
    """
    if server.landmarks.writes(id):
        raise ConflictError(
            f"Session {id} is being written: reset localization to begin another one, or stop SLAM."
        )
    server.landmarks.atlas.delete(id)
    server.runtime.navigate(lambda navigation: navigation.leave_map(id))
