"""Landmarks of a map: where, which, and those nearest to a point."""

import io
import math
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.errors import UnknownLandmarkError
from lidarcore.landmarks import MAX_ID, Landmark, LandmarkMap, Metric, Neighbour, write_landmarks

from ...errors import NotFoundError
from ...jobs.maps.names import stem_of
from ...jobs.maps.store import LandmarkStore
from ..answers.downloads import file_of
from ..dependencies import Server
from ..openapi import formats
from ..problems import documented, encode
from ..requests.map_queries import MOST, USUAL, Limit, Metres, Region, Which
from ..schemas import Finite

router = APIRouter(prefix="/landmarks", tags=["landmarks"], responses=documented(404, 422, 503))


class LandmarksJson(TypedDict):
    session: int
    landmarks: list[Landmark]
    next: int | None


class NeighboursJson(TypedDict):
    session: int
    neighbours: list[Neighbour]


class LandmarkHistoryJson(TypedDict):
    """`landmark` is null if it was removed: its last state is the last of the history."""

    session: int
    landmark: Landmark | None
    history: list[Landmark]
    next: float | None


SessionId = Annotated[
    int | None, Query(description="which map; if not given the one that is written or used, else the newest")
]


def chosen_map(landmarks: LandmarkStore, session: int | None) -> LandmarkMap:
    """The map asked for. Raises UnknownSessionError, or NotFoundError if there is none at all."""
    found = landmarks.map(session)
    if found is None:
        raise NotFoundError(
            "There is no map of landmarks yet: set navigation.mode to slam and navigation.method to landmarks, or "
            "load one. A map of whole scans is in /walls and /map/grid."
        )
    return found


@router.get(
    "",
    response_model=LandmarksJson,
    response_description="A page; for the one after it give `next` as `after`, or follow the Link header",
    responses=formats(
        csv="x_m,y_m,var_x_m2,cov_xy_m2,...", geojson={"type": "FeatureCollection", "features": []}
    ),
)
def find(
    server: Server,
    request: Request,
    region: Region,
    which: Which,
    limit: Limit = USUAL,
    after: Annotated[int, Query(ge=0, le=MAX_ID, description="`next` of the page before")] = 0,
    session: SessionId = None,
    format: Annotated[Literal["json", "csv", "geojson"], Query(description="of the answer")] = "json",
) -> Response:
    """Landmarks in a box or a circle, or anywhere, in the order of their ids. Metres, world frame of the session."""
    landmark_map = chosen_map(server.landmarks, session)
    page = landmark_map.find(region, which, after, limit)
    if format == "json":
        answer = encode({"session": landmark_map.session, "landmarks": page.landmarks, "next": page.next})
    else:
        text = io.StringIO(newline="")
        write_landmarks(page.landmarks, text, format)
        stem = stem_of(server.landmarks.atlas, landmark_map.session)
        answer = file_of(text.getvalue(), format, f"{stem}-landmarks")
    if page.next is not None:
        following = request.url.include_query_params(after=page.next)
        answer.headers["Link"] = f'<{following.path}?{following.query}>; rel="next"'
    return answer


@router.get("/nearest", response_model=NeighboursJson, response_description="The nearest first")
def nearest(
    server: Server,
    which: Which,
    x: Annotated[Metres, Query(description="m", examples=[1.0])],
    y: Annotated[Metres, Query(description="m", examples=[0.5])],
    k: Annotated[int, Query(ge=1, le=MOST, description="how many")] = 1,
    metric: Annotated[
        Metric, Query(description="m, or in standard deviations of landmark and point")
    ] = "euclidean",
    within: Annotated[Finite, Query(ge=0, description="largest distance")] = math.inf,
    sigma: Annotated[
        float, Query(ge=0, le=1e6, description="m, of the point, in each direction, for mahalanobis")
    ] = 0.0,
    session: SessionId = None,
) -> Response:
    """The k landmarks nearest to a point."""
    landmark_map = chosen_map(server.landmarks, session)
    noise = [[sigma**2, 0.0], [0.0, sigma**2]] if sigma else None
    found = landmark_map.nearest((x, y), k, which, within, metric, noise)
    return encode({"session": landmark_map.session, "neighbours": found})


@router.get("/{id}", response_model=LandmarkHistoryJson, response_description="The landmark")
def read(
    server: Server,
    id: int,
    after: Annotated[Finite, Query(description="s: `next` of the page before")] = -math.inf,
    limit: Limit = USUAL,
) -> Response:
    """One landmark, and what it was in each second in which it was seen, the oldest first; also if it was removed."""
    landmark_map = server.landmarks.atlas.holding(id)
    history = landmark_map.history(id, after, limit)
    return encode(
        {
            "session": landmark_map.session,
            "landmark": _present(landmark_map, id),
            "history": history,
            "next": history[-1].last_seen if len(history) == limit else None,
        }
    )


@router.delete("", status_code=204)
def clear(server: Server, session: SessionId = None) -> None:
    """Give up the landmarks of a map and their history. What a run goes on seeing comes back: reset it before."""
    chosen_map(server.landmarks, session).clear()


def _present(landmark_map: LandmarkMap, id: int) -> Landmark | None:
    try:
        return landmark_map[id]
    except UnknownLandmarkError:
        return None
