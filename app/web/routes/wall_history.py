"""What a wall of a map of whole scans was, from second to second."""

import math
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.errors import UnknownWallError

from ...errors import NotFoundError
from ...jobs.maps.store import LandmarkStore
from ...jobs.maps.wall_writer import from_stored
from ...pipeline.runtime import Runtime
from ..answers.wall_json import WallJson, wall_rows
from ..dependencies import Server
from ..problems import documented, encode
from ..requests.map_queries import USUAL, Limit
from ..schemas import Finite

router = APIRouter(tags=["localization"], responses=documented(404, 422, 503))


NO_SESSION = "No map is kept yet: wait for further scans, or give the session of one that is kept."


class WallHistoryJson(TypedDict):
    """`wall` is null if it is no longer in the map: its last state is the last of the history.

    `session` is null, and the history empty, of a wall of the running map before anything of it is kept.
    """

    session: int | None
    wall: WallJson | None
    history: list[WallJson]
    next: float | None


@router.get(
    "/walls/{id}/history",
    response_model=WallHistoryJson,
    response_description="The wall",
)
def history(
    server: Server,
    id: int,
    after: Annotated[Finite, Query(description="s: `next` of the page before")] = -math.inf,
    limit: Limit = USUAL,
    session: Annotated[
        int | None, Query(description="which map; if not given the one that is written or used")
    ] = None,
) -> Response:
    """One wall of a map that is kept, and what it was in each second in which it was seen, the oldest first.

    So also of one that became part of another. It begins when three keyframes have seen the wall; of a wall of the
    running map it is empty until then.
    """
    kept = server.landmarks.session if session is None else session
    try:
        return encode(_kept_history(server.landmarks, kept, id, after, limit))
    except (NotFoundError, UnknownWallError):
        wall = _running_wall(server.runtime, id) if session is None else None
        if wall is None:
            raise
        return encode({"session": kept, "wall": wall, "history": [], "next": None})


def _kept_history(
    landmarks: LandmarkStore, session: int | None, id: int, after: float, limit: int
) -> WallHistoryJson:
    if session is None:
        raise NotFoundError(NO_SESSION)
    wall_map = landmarks.atlas[session]
    found = from_stored(wall_map.wall_history(id, after, limit))
    present = from_stored([wall for wall in wall_map.walls() if wall.id == id])
    return {
        "session": session,
        "wall": next(iter(wall_rows(present, range(len(present)))), None),
        "history": wall_rows(found, range(len(found))),
        "next": float(found.last_seen[-1]) if len(found) == limit else None,
    }


def _running_wall(runtime: Runtime, id: int) -> WallJson | None:
    """A wall of the map that SLAM makes now."""
    picture = runtime.navigation.picture
    if picture is None or picture.walls is None:
        return None
    return next(iter(wall_rows(picture.walls, np.flatnonzero(picture.walls.ids == id).tolist())), None)
