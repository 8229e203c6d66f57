"""Sessions: the runs, and imported files, that have a map of their own."""

from typing import Annotated

from fastapi import APIRouter, Path
from starlette.responses import Response
from typing_extensions import TypedDict

from app.api.dependencies import CurrentLandmarks
from app.api.examples import SESSION, ok
from app.landmark_store import LandmarkStoreJson
from app.problems import ProblemError, documented, encode

router = APIRouter(prefix="/sessions", tags=["landmarks"], responses=documented(503))


class SessionJson(TypedDict):
    """Times in s since 1970, by the computer's clock; `ended` null while it runs or if it was killed."""

    id: int
    source: str
    mode: str
    started: float
    ended: float | None
    landmarks: int


class SessionsJson(TypedDict):
    store: LandmarkStoreJson
    sessions: list[SessionJson]


STORE = {"path": "recordings/landmarks.db", "session": 3, "landmarks": 27, "behind_s": 0.0, "error": None}
EXAMPLE = {"store": STORE, "sessions": [SESSION]}


@router.get("", response_model=SessionsJson, responses=ok(EXAMPLE, "All sessions, the oldest first"))
def read(landmarks: CurrentLandmarks) -> Response:
    """The maps there are, and how well the running one gets to the disk."""
    return encode({"store": landmarks.status, "sessions": landmarks.atlas.sessions()})


@router.delete("/{id}", status_code=204, responses=documented(404, 409, 422))
def delete(landmarks: CurrentLandmarks, id: Annotated[int, Path(examples=[3])]) -> None:
    """Delete a session with its landmarks and their history. 409 for the one that is being written."""
    if landmarks.writes(id):
        raise ProblemError(409, f"Session {id} is being written: begin another one by a reset, or stop SLAM.")
    landmarks.atlas.delete(id)
