"""Landmarks of a map: where, which, and those nearest to a point."""

import io
import math
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request
from pydantic import Field
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore.errors import UnknownLandmarkError
from lidarcore.landmarks import (
    MAX_COORDINATE,
    MAX_ID,
    Box,
    Circle,
    Filter,
    Landmark,
    LandmarkMap,
    Metric,
    Neighbour,
    write_landmarks,
)

from ...errors import NotFoundError
from ...jobs.maps.names import stem_of
from ...jobs.maps.store import LandmarkStore
from ..dependencies import Server
from ..downloads import text_file
from ..openapi import formats
from ..problems import ProblemError, documented, encode
from ..schemas import Finite

MOST, USUAL = 1000, 100  # landmarks of a page

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


Metres = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, allow_inf_nan=False)]

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


async def _region(
    bbox: Annotated[
        str | None, Query(description="min_x,min_y,max_x,max_y in m", examples=["-2.5,-2,4,2.5"])
    ] = None,
    x: Annotated[Metres | None, Query(description="m")] = None,
    y: Annotated[Metres | None, Query(description="m")] = None,
    radius: Annotated[float | None, Query(ge=0, allow_inf_nan=False, description="m about x, y")] = None,
) -> Box | Circle | None:
    """A box or a circle. Raises ProblemError 422 if it is neither."""
    if (x is None) != (y is None) or (y is None) != (radius is None):
        raise ProblemError(422, "A circle has x, y and radius: give all three, or none.")
    if bbox is None:
        return None if x is None or y is None or radius is None else Circle(x, y, radius)
    if radius is not None:
        raise ProblemError(422, "Give bbox, or x, y and radius, not both.")
    try:
        x_min, y_min, x_max, y_max = map(float, bbox.split(","))
    except ValueError as error:
        raise ProblemError(422, f"bbox is {bbox!r}: give min_x,min_y,max_x,max_y in metres.") from error
    if any(map(math.isnan, (x_min, y_min, x_max, y_max))):
        raise ProblemError(
            422, f"bbox is {bbox!r}: nan is no number; give min_x,min_y,max_x,max_y in metres."
        )
    if not (x_min <= x_max and y_min <= y_max):
        raise ProblemError(
            422, f"bbox is {bbox!r}: give min_x,min_y,max_x,max_y, no minimum above its maximum."
        )
    return Box(x_min, y_min, x_max, y_max)


async def _filter(
    kind: Annotated[list[str], Query(description="corner, post, ...; may be repeated")] = [],  # noqa: B006
    method: Annotated[list[str], Query(description="what found it; may be repeated")] = [],  # noqa: B006
    since: Annotated[Finite, Query(description="s: seen then or later")] = -math.inf,
    until: Annotated[Finite, Query(description="s: seen then or before")] = math.inf,
    min_count: Annotated[int, Query(ge=0, le=MAX_ID, description="seen at least so often")] = 1,
    max_sigma: Annotated[
        Finite, Query(ge=0, description="m, along the longest axis of the ellipse")
    ] = math.inf,
) -> Filter:
    """Which landmarks count. Raises ProblemError 422 if since is after until."""
    if since > until:
        raise ProblemError(422, f"since ({since:.15g} s) is after until ({until:.15g} s): swap them.")
    return Filter(
        kinds=tuple(kind),
        methods=tuple(method),
        seen_from=since,
        seen_to=until,
        min_count=min_count,
        max_sigma=max_sigma,
    )


Region = Annotated[Box | Circle | None, Depends(_region)]
Which = Annotated[Filter, Depends(_filter)]
Limit = Annotated[int, Query(ge=1, le=MOST, description="at most so many")]


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
        answer = text_file(text.getvalue(), format, f"{stem}-landmarks")
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
