"""The current frame, its segments, its corners and its clusters."""

from dataclasses import replace
from typing import Annotated, Literal

from fastapi import APIRouter, Query, WebSocket
from starlette.responses import Response

from lidarcore import Features
from lidarcore.clusters import CLUSTERERS, cluster

from ...errors import NotFoundError
from ...pipeline.frame import Frame
from ...pipeline.tables import CORNER_COLUMNS, SEGMENT_COLUMNS, Columns, csv_text, values
from ..answers.downloads import file_of
from ..answers.serializers import clusters_json, corners_json, frame_text, segments_json
from ..dependencies import CurrentFrame, Server
from ..openapi import formats
from ..problems import documented, encode
from ..schemas import ClusterJson, CornerJson, FrameJson, SegmentJson

router = APIRouter(tags=["frame"], responses=documented(404, 422, 503))

Fitter = Annotated[
    str | None, Query(description="a method of the frame; the main one if not given", examples=["ml"])
]
Format = Annotated[Literal["json", "csv"], Query(description="JSON, or CSV with a header")]
Method = Annotated[
    str | None,
    Query(description="a clustering method; the one of the settings if not given", examples=["dbscan"]),
]
Points = Annotated[bool, Query(description="with the measured points")]


@router.get("/frame", response_model=FrameJson, response_description="The newest frame")
def frame(frame: CurrentFrame, points: Points = False) -> Response:
    """Everything found in the newest scan, by every method that runs."""
    return Response(frame_text(frame, points), media_type="application/json")


@router.get(
    "/segments",
    response_model=list[SegmentJson],
    response_description="The segments of the newest scan",
    responses=formats(csv="id,alpha,r,x_start,y_start,..."),
)
def segments(frame: CurrentFrame, fitter: Fitter = None, format: Format = "json") -> Response:
    """The segments by one method, in the order of the ring. Metres and radians, sensor frame."""
    found = _features(frame, fitter)
    if format == "csv":
        return _csv("segments", list(range(len(found.segments))), SEGMENT_COLUMNS, found)
    return encode(segments_json(found))


@router.get(
    "/corners",
    response_model=list[CornerJson],
    response_description="The corners of the newest scan",
    responses=formats(csv="id,segment_1,segment_2,x,y,..."),
)
def corners(frame: CurrentFrame, fitter: Fitter = None, format: Format = "json") -> Response:
    """The corners that one method found; ids last from frame to frame. Metres and radians, sensor frame."""
    found, name = _features(frame, fitter), fitter or next(iter(frame.features))
    if format == "csv":
        ids = {row.index[name]: row.id for row in frame.corners if name in row.index}
        return _csv("corners", [ids[i] for i in range(len(found.corners))], CORNER_COLUMNS, found)
    by_it = [row for row in corners_json(frame) if name in row["by_method"]]
    return encode([row | {"by_method": {name: row["by_method"][name]}} for row in by_it])


@router.get(
    "/clusters",
    response_model=list[ClusterJson],
    response_description="The clusters of the newest scan",
)
def clusters(frame: CurrentFrame, method: Method = None) -> Response:
    """The clusters of the newest scan, found when asked for. Metres, sensor frame."""
    if method is not None and method not in CLUSTERERS:
        raise NotFoundError(f"There is no clustering method {method!r}: choose from {', '.join(CLUSTERERS)}.")
    wanted = frame.settings.clusters
    chosen = replace(wanted, method=method or wanted.method)
    return encode(clusters_json(cluster(frame.scan, chosen)))


@router.websocket("/stream")
async def stream(server: Server, websocket: WebSocket, points: Points = False) -> None:
    """Frames and changes of state as they happen, newest first; a slow client gets fewer, never old ones."""
    await websocket.accept()
    await server.hub.serve(websocket, points)


def _features(frame: Frame, fitter: str | None) -> Features:
    if fitter is None:
        return frame.main
    if fitter not in frame.features:
        has = ", ".join(frame.features)
        raise NotFoundError(f"The frame has no {fitter!r}, only {has}: set it as fitter, or compare with it.")
    return frame.features[fitter]


def _csv(stem: str, ids: list[int], columns: Columns, features: Features) -> Response:
    return file_of(csv_text({"id": ids, **values(columns, features)}), "csv", stem)
